"""The body as animation programs have it: bones without rotation in a rest pose, and their rotations since.

One bone per segment, named and scaled as asked for, in the program's axes. In the rest pose the body faces along -y
where z is up, so along +z where y is, as such programs want it; in the motion it is where it was in the world.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.posture import raised
from bodycam_ros.body.segment_name import LEFT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.markers import bone_tip
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion, change_axes
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint_angles import EulerOrder

WORLD_R_REST = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # ours faces along x
_MAX_DEPTH = 200  # of bones on each other: programs go down them by recursion

REST_POSES: Mapping[str, float] = {"N": 0.0, "T": np.pi / 2.0, "A": np.pi / 4.0}
"""Rest pose -> how far the arms are raised sideways from the N-pose [rad]."""

_KINDS = ("pelvis", "torso", "head", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")
_TRUNK = 3  # kinds without a side, which stand first

BONE_NAMES: Mapping[str, tuple[str, str, str, str]] = {
    # Blender mirrors what ends in .L and .R; "cmu" are the skeletons (ASF) of the CMU Graphics Lab's database.
    "blender": ("{}", "{}.L", "{}.R", "hips spine head upper_arm forearm hand thigh shin foot"),
    "mixamo": (
        "mixamorig:{}", "mixamorig:Left{}", "mixamorig:Right{}", "Hips Spine Head Arm ForeArm Hand UpLeg Leg Foot"
    ),
    "cmu": ("{}", "l{}", "r{}", "root lowerback head humerus radius hand femur tibia foot"),
    "unreal": ("{}", "{}_l", "{}_r", "pelvis spine_01 head upperarm lowerarm hand thigh calf foot"),
}  # fmt: skip
"""Convention -> patterns of central, left and right names, and its words for ``_KINDS``; others keep their names."""


@dataclass(frozen=True, eq=False)
class Figure:
    """N bones, each after its parent, over T frames; lengths in units of the file.

    Attributes:
        segments: (N) that the bones stand for.
        names: (N) of the bones.
        parents: (N) rows of their parents; -1 of the root, which is the first.
        rest: (N, 4, 4) poses of the segments in the rest pose, the root at the origin, in the program's axes.
        tips: row of each bone without children -> (3,) its end, from its start in the rest pose.
        positions: (T, N, 3) of the bones' starts.
        rotations: (T, N, 3, 3) of each since the rest pose, about the program's axes.
    """

    segments: tuple[str, ...]
    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest: Array
    tips: dict[int, Array]
    positions: Array
    rotations: Array

    @classmethod
    def from_motion(cls, motion: SampledMotion, options: MotionOptions, up: str) -> "Figure":
        """The figure of a motion, in axes of which one is up unless the options change it.

        Raises:
            BodyError: two bones would have the same name, or a chain of them is too long.
        """
        body, segments = motion.body, motion.body_segments
        program_R_world, scale = UP_AXES[options.up or up], options.scale or 1.0
        rows = [body.segment_index[segment] for segment in segments]
        parents = tuple(segments.index(motion.parents[s]) if s in motion.parents else -1 for s in segments)
        _check_depth(segments, parents)
        world_T_rest = rigid(WORLD_R_REST, np.zeros(3)) @ rest_pose(body, options.pose or "N")[rows]
        moved = motion.world_T_segment[:, rows]
        since_rest = moved[..., :3, :3] @ np.swapaxes(world_T_rest[:, :3, :3], -1, -2)
        rest = rigid(program_R_world @ world_T_rest[:, :3, :3], scale * world_T_rest[:, :3, 3] @ program_R_world.T)
        leaves = {row: bone_tip(body, s) for row, s in enumerate(segments) if row not in parents}
        return cls(
            segments=segments,
            names=bone_names(segments, options.names),
            parents=parents,
            rest=rest,
            tips={row: scale * rest[row, :3, :3] @ tip for row, tip in leaves.items()},
            positions=scale * moved[..., :3, 3] @ program_R_world.T,
            rotations=change_axes(program_R_world, since_rest),
        )

    @cached_property
    def offsets(self) -> Array:
        """(N, 3) start of each bone from its parent's, in the rest pose; of the root its own position there."""
        starts = self.rest[:, :3, 3]
        offsets: Array = starts - np.where(np.array(self.parents)[:, None] < 0, 0.0, starts[list(self.parents)])
        return offsets

    @cached_property
    def local_rotations(self) -> Array:
        """(T, N, 3, 3) rotation of each bone against its parent."""
        local: Array = self.rotations.copy()
        above = self.rotations[:, self.parents[1:]]
        local[:, 1:] = np.swapaxes(above, -1, -2) @ self.rotations[:, 1:]
        return local

    def children(self, row: int) -> list[int]:
        """Rows of the bones on a bone."""
        return [child for child, parent in enumerate(self.parents) if parent == row]

    def ends(self, row: int) -> list[Array]:
        """(3,) ends of a bone from its start, in the rest pose: its children's starts, or its tip."""
        return [self.offsets[child] for child in self.children(row)] or [self.tips[row]]


def rest_pose(body: BodyModel, name: str) -> Array:
    """Poses root_T_segment (S, 4, 4) of a body in a rest pose, a key of ``REST_POSES`` [m].

    Palms of raised arms face down. A body without arms stands as in the
    N-pose.
    """
    return raised(body, body.n_pose(np.eye(4)), "upper_arm", REST_POSES[name])


def bone_names(segments: Sequence[str], convention: str | None) -> tuple[str, ...]:
    """Names of segments by a convention, or their own; without spaces, which end a name in many formats.

    Raises:
        BodyError: two would have the same name.
    """
    names = tuple("_".join(_conventional(segment, convention).split()) for segment in segments)
    if twice := sorted(name for name, count in Counter(names).items() if count > 1):
        raise BodyError(f"two segments would be named {', '.join(twice)}; leave --names away, or rename one of them")
    return names


def continuous_angles(orders: tuple[str, ...], rotations: Array) -> Array:
    """(T, N, 3) intrinsic angles [rad] of rotations (T, N, 3, 3) in N orders, nearest to those of the frame before."""
    euler, angles = EulerOrder(orders), np.empty(rotations.shape[:-1])
    previous = np.zeros((len(orders), 3))
    for frame, rotations_frame in enumerate(rotations):
        previous = angles[frame] = euler.decompose(rotations_frame, previous)
    return angles


def _conventional(segment: str, convention: str | None) -> str:
    name = SegmentName(segment)
    if convention is None or name.kind not in _KINDS:
        return segment
    central, left, right, words = BONE_NAMES[convention]
    row = _KINDS.index(name.kind)
    if (row < _TRUNK) == bool(name.side):
        return segment
    pattern = central if row < _TRUNK else left if name.side == LEFT else right
    return pattern.format(words.split()[row])


def _check_depth(segments: tuple[str, ...], parents: tuple[int, ...]) -> None:
    depths: list[int] = []
    for segment, parent in zip(segments, parents, strict=True):
        depths.append(1 if parent < 0 else depths[parent] + 1)
        if depths[-1] > _MAX_DEPTH:
            raise BodyError(f"segment {segment}: a chain of more than {_MAX_DEPTH} segments is not written as bones")
