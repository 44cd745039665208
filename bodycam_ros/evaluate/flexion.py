"""One telling angle per limb."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

LIMBS: Mapping[str, tuple[str, float]] = {
    "hip": ("thigh", 1.0),
    "knee": ("shin", -1.0),
    "shoulder": ("upper_arm", 1.0),
    "elbow": ("forearm", 1.0),
}
"""Joint -> the kind of segment that it moves, and the sign that makes bending positive: a knee bends backwards."""


@dataclass(frozen=True)
class LimbJoint:
    """A joint to be shown.

    Attributes:
        name: "hip".
        segment: "thigh_left".
        sign: of its bending.
    """

    name: str
    segment: str
    sign: float


def limb_joints(segments: tuple[str, ...]) -> tuple[LimbJoint, ...]:
    """The joints of arms and legs that a body has, left before right."""
    return tuple(
        LimbJoint(name, f"{kind}_{side}", sign)
        for name, (kind, sign) in LIMBS.items()
        for side in ("left", "right")
        if f"{kind}_{side}" in segments
    )


def flexion(parent_R_child: Array) -> Array:
    """Angle (T,) [rad] of a limb's long axis to its parent's, in the parent's sagittal plane, forward positive.

    Segments hang along -z in the N-pose, x forward, so the limb's direction d in the parent is minus the third column
    of the rotation (T, 3, 3), and the angle atan2(d_x, -d_z), continuous over time.
    """
    direction = -parent_R_child[:, :, 2]
    angle: Array = np.unwrap(np.arctan2(direction[:, 0], -direction[:, 2]))
    return angle
