"""One telling angle per limb."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array

LIMBS: Mapping[str, str] = {"hip": "thigh", "knee": "shin", "shoulder": "upper_arm", "elbow": "forearm"}
"""Joint -> the kind of segment that it moves."""

_BENDS_BACKWARDS = "knee"
_MOVES_ALL_ROUND = "shoulder"


@dataclass(frozen=True)
class LimbJoint:
    """A joint to be shown.

    Attributes:
        name: "hip".
        segment: "thigh_left".
    """

    name: str
    segment: str


def limb_joints(segments: tuple[str, ...]) -> tuple[LimbJoint, ...]:
    """The joints of arms and legs that a body has, left before right."""
    return tuple(
        LimbJoint(name, f"{kind}_{side}")
        for name, kind in LIMBS.items()
        for side in ("left", "right")
        if f"{kind}_{side}" in segments
    )


def flexion(joint: str, parent_R_child: Array) -> Array:
    """Angle (T,) [rad] of a limb's long axis to its parent's, zero in the N-pose, continuous over time.

    Segments hang along -z in the N-pose, x forward, so the limb's direction d in the parent is minus the third column
    of the rotation (T, 3, 3). Hip, knee and elbow: atan2(d_x, -d_z) in the parent's sagittal plane, in the direction in
    which they bend. Shoulder: the angle between d and -z, because an arm that is raised sideways leaves that plane.
    """
    forward, _, up = -np.moveaxis(parent_R_child[:, :, 2], -1, 0)
    if joint == _MOVES_ALL_ROUND:
        raised: Array = np.arccos(np.clip(-up, -1.0, 1.0))
        return raised
    bent: Array = np.unwrap(np.arctan2(forward, -up))
    return -bent if joint == _BENDS_BACKWARDS else bent
