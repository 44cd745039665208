"""A joint: its place on two segments, and the motion that it permits, as six sigmas.

A joint has a frame on each of its two segments. Ball, hinge, weld and free differ only in which of the six sigmas
between those frames are loose, so the estimator needs no code of its own for any of them.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import shown
from bodycam_ros.geometry import Array, exp_so3, inverse

JointType = Literal["ball", "hinge", "weld", "free"]

LOOSE_M = 100.0  # [m] of a free joint: no opinion
LOOSE_RAD = 10.0  # [rad] three turns: no opinion on a free rotation, yet the information matrix stays invertible
TIGHT_RAD = 2e-4  # [rad] 0.1 mm at the end of a thigh: stiffer than any mount, softer than rounding
TIGHT_M = 1e-4  # [m] leaves gaps of some micrometres; a millionth of what is loose is too stiff for a Cholesky factor
FULL_TURN = 2.0 * np.pi  # [rad]
FARTHEST_M = 100.0  # [m] of a place from its segment's origin; farther, a rotation's rounding tears joints apart
LONG_AXIS_Z = "yzx"  # a segment that hangs or stands in the N-pose: its long axis, z, in the middle (DESIGN 3)

_LOOSE_ROTATIONS: dict[str, int] = {"ball": 3, "hinge": 1, "weld": 0, "free": 3}


def default_sigmas(joint_type: JointType) -> tuple[float, ...]:
    """Sigmas (6) of a joint type: the rotations that it leaves free, the ones that it holds, the translation."""
    loose = _LOOSE_ROTATIONS[joint_type]
    place_m = LOOSE_M if joint_type == "free" else TIGHT_M
    return (LOOSE_RAD,) * loose + (TIGHT_RAD,) * (3 - loose) + (place_m,) * 3


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint between two segments.

    Its *joint rotation* is ``parent_joint_R_child_joint``, the rotation between its frames on the two segments:
    anything for a ball, about the axis for a hinge, the identity for a weld. A free joint holds nothing: its child, a
    machine that stands beside the body, has a place in its parent as well, ``parent_joint_T_child_joint``.

    Attributes:
        name: unique in a body.
        parent: the segment nearer to the root.
        child: the other segment.
        type: "ball", "hinge", "weld" or "free".
        parent_T_joint: (4, 4) the joint's frame on the parent segment [m].
        child_T_joint: (4, 4) the joint's frame on the child segment [m]. The identity where the child's origin is
            the joint to its parent, as for every joint of the tree (docs/joints.md).
        axis: (3,) unit vector in the joint's frame; of a hinge only.
        angle_axes: intrinsic order of the three joint angles of a ball; the middle one is the child's long axis.
        sigmas: (6) rotation [rad], then translation [m], in the joint's frame; a hinge's rotations are about its
            axis first, then across it. None: those of the type.
        limits: (low, high) [rad] per joint angle, or None if unknown.

    Raises:
        BodyError: a value that makes no joint.
    """

    name: str
    parent: str
    child: str
    type: JointType
    parent_T_joint: Array
    child_T_joint: Array = field(default_factory=lambda: np.eye(4))
    axis: Array = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    angle_axes: str = LONG_AXIS_Z
    sigmas: tuple[float, ...] | None = None
    limits: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        where = f"joint {self.name}"
        if self.type not in get_args(JointType):
            raise BodyError(f"{where}: type must be ball, hinge, weld or free, not {shown(self.type)}")
        if self.parent == self.child:
            raise BodyError(f"{where}: joins segment {self.parent} to itself; parent and child must differ")
        if sorted(self.angle_axes) != ["x", "y", "z"]:
            axes = shown(self.angle_axes)
            raise BodyError(f"{where}: angle_axes must hold x, y and z once each, such as yzx, not {axes}")
        if not np.isfinite([self.parent_T_joint, self.child_T_joint]).all():
            raise BodyError(f"{where}: its place on a segment is not finite")
        check_within_reach(where, self.parent_T_joint, self.child_T_joint)
        length = float(np.linalg.norm(self.axis))
        if not np.isfinite(length) or length == 0.0:
            raise BodyError(f"{where}: axis must be a direction, not {np.asarray(self.axis).tolist()}")
        object.__setattr__(self, "axis", self.axis / length)
        sigmas = default_sigmas(self.type) if self.sigmas is None else self.sigmas
        if len(sigmas) != 6 or not all(np.isfinite(s) and s > 0 for s in sigmas):
            raise BodyError(f"{where}: sigmas must be 6 positive numbers, rotation [rad] then translation [m]")
        object.__setattr__(self, "sigmas", tuple(sigmas))
        if self.limits is not None:
            if self.type == "free":
                raise BodyError(f"{where}: a free joint holds nothing, so it has no limits")
            if len(self.limits) != len(self.angle_names):
                raise BodyError(f"{where}: limits must be {len(self.angle_names)} pairs, not {len(self.limits)}")
            if not all(low < high for low, high in self.limits):
                raise BodyError(f"{where}: each of the limits must be a pair of numbers, low before high")

    @cached_property
    def angle_names(self) -> tuple[str, ...]:
        """Names of its angles: three of a ball, one of a hinge, none of a weld; of a free joint x, y, z [m] first."""
        if self.type in ("ball", "free"):
            angles = tuple(f"{self.name}_{axis}" for axis in self.angle_axes)
            return angles if self.type == "ball" else (*(f"{self.name}_at_{axis}" for axis in "xyz"), *angles)
        return (self.name,) if self.type == "hinge" else ()

    def free_rows(self, slide_m: float = LOOSE_M) -> tuple[int, ...]:
        """Which of its six rows, those of ``sigmas``, are free: rotations by the type, and what slides.

        Args:
            slide_m: a joint slides along the axes whose sigma is this or more [m]; a free joint along all.
        """
        assert self.sigmas is not None  # set when it was made
        slides = (row for row in range(3, 6) if self.type == "free" or self.sigmas[row] >= slide_m)
        return (*range(_LOOSE_ROTATIONS[self.type]), *slides)

    def free_twists(self, slide_m: float = LOOSE_M) -> Array:
        """(6, F) twists xi of its free rows in its frame, rotation first: motion = exp(sum theta xi) (B eq. 2)."""
        axes = np.eye(6)
        axes[:3, :3] = self.axes_of_rotation.T
        twists: Array = axes[:, self.free_rows(slide_m)]
        return twists

    @cached_property
    def counts_turns(self) -> bool:
        """Whether its angles grow without bound: of a free joint, and of a hinge that may turn by more than one turn.

        The published angles of every other joint stay within one turn either way.
        """
        if self.type == "hinge":
            return self.limits is None or float(np.abs(self.limits).max()) > FULL_TURN
        return self.type == "free"

    @cached_property
    def joint_T_child(self) -> Array:
        """(4, 4) inverse of ``child_T_joint``."""
        return inverse(self.child_T_joint)

    def permitted_rotation(self, joint_rotation: Array) -> Array:
        """The part (..., 3, 3) of a joint rotation (..., 3, 3) that the type permits."""
        if self.type in ("ball", "free"):
            return joint_rotation
        if self.type == "hinge":
            return self.hinge_rotation(hinge_angle(joint_rotation, self.axis))
        return np.broadcast_to(np.eye(3), joint_rotation.shape).copy()

    def hinge_rotation(self, angle: NDArray[np.floating]) -> Array:
        """Joint rotation (..., 3, 3) of a hinge's angle (...) [rad]."""
        return exp_so3(np.asarray(angle)[..., None] * self.axis)

    @cached_property
    def axes_of_rotation(self) -> Array:
        """(3, 3) rows: the hinge's axis and two directions across it; the joint's own axes for other types."""
        if self.type != "hinge":
            return np.eye(3)
        across = np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
        across /= np.linalg.norm(across)
        return np.stack([self.axis, across, np.cross(self.axis, across)])


def check_within_reach(where: str, *places: Array) -> None:
    """Refuse places (4, 4) on a segment that are beyond any body, or any machine that a body holds.

    Raises:
        BodyError: one is.
    """
    far_m = max(float(np.linalg.norm(place[:3, 3])) for place in places)
    if far_m > FARTHEST_M:
        raise BodyError(
            f"{where}: its place is {far_m:g} m from its segment's origin; places are in metres, and none may be "
            f"farther than {FARTHEST_M:g} m"
        )


def hinge_angle(rotation: Array, axis: Array) -> Array:
    """Angle (...) [rad], in -pi to pi, of the part of rotations (..., 3, 3) about unit axes (..., 3).

    It minimises the Frobenius distance to the rotation, which is the twist of the swing-twist decomposition of its
    quaternion (Dobrowolski 2015, "Swing-twist decomposition in Clifford algebra"), and stays defined at half a turn.
    """
    sine = (
        axis[..., 0] * (rotation[..., 2, 1] - rotation[..., 1, 2])
        + axis[..., 1] * (rotation[..., 0, 2] - rotation[..., 2, 0])
        + axis[..., 2] * (rotation[..., 1, 0] - rotation[..., 0, 1])
    )
    trace = rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2]
    cosine = trace - np.sum((rotation @ axis[..., None])[..., 0] * axis, axis=-1)
    angle: Array = np.arctan2(sine, cosine)
    return angle
