"""The lines that a body is drawn with, and a view in which both its legs and arms stay apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel, bone_ends
from bodycam_ros.geometry import Array, transform_points

_TIPS_M = {
    "head": (0.0, 0.0, 0.20),
    "forearm": (0.0, 0.0, -0.25),
    "hand": (0.0, 0.0, -0.15),
    "foot": (0.17, 0.0, -0.06),
}
"""Where a last segment ends, for drawing only: fingertips, toes and the crown are not measured."""

HEAD = "head"

_TURN_WALKING = np.radians(20.0)  # from the side towards the front: both legs and arms stay apart
_TURN_STANDING = np.radians(50.0)  # of a person who stays in place
_ELEVATION = np.radians(14.0)  # enough to see the path on the floor
_STANDING_M = 1.5  # a root that moves less stands: the view follows its heading


@dataclass(frozen=True, eq=False)
class Bone:
    """A line over T states.

    Attributes:
        segment: that it belongs to.
        start, end: (T, 3) [m].
        is_equipment: whether it is of the equipment.
    """

    segment: str
    start: Array
    end: Array
    is_equipment: bool = False

    def at(self, instant: int) -> "Bone":
        """The line at one state."""
        row = slice(instant, instant + 1)
        return replace(self, start=self.start[row], end=self.end[row])


def bones(world_T_segment: Mapping[str, Array], parents: Mapping[str, str]) -> list[Bone]:
    """A line from the origin of each segment to that of each child, and to the tips of the last ones.

    Args:
        world_T_segment: segment -> (T, 4, 4) [m].
        parents: segment -> its parent segment.
    """
    origin = {segment: poses[:, :3, 3] for segment, poses in world_T_segment.items()}
    lines = [Bone(p, origin[p], origin[c]) for c, p in parents.items() if c in origin and p in origin]
    with_children = {bone.segment for bone in lines}
    for segment, poses in world_T_segment.items():
        kind = segment.removesuffix("_left").removesuffix("_right")
        if segment not in with_children and kind in _TIPS_M:
            tip = transform_points(poses, np.array([_TIPS_M[kind]]))[:, 0]
            lines.append(Bone(segment, origin[segment], tip))
    return lines


def equipment_lines(world_T_segment: Mapping[str, Array], ends: Mapping[str, Sequence[Array]]) -> list[Bone]:
    """Lines of the equipment, from the origin of each segment.

    Args:
        world_T_segment: segment -> (T, 4, 4) [m].
        ends: segment -> where its lines end (3,), in its own axes [m].
    """
    return [
        Bone(
            segment,
            world_T_segment[segment][:, :3, 3],
            transform_points(world_T_segment[segment], end[None])[:, 0],
            True,
        )
        for segment, all_ends in ends.items()
        for end in all_ends
    ]


def body_bones(body: BodyModel, world_T_segment: Array) -> list[Bone]:
    """The lines of a body and its equipment at poses (S, 4, 4) [m]."""
    poses = dict(zip(body.segments, world_T_segment[:, None], strict=True))
    equipment = body.equipment_segments
    ends = {segment: bone_ends(body, segment) for segment in body.segments if segment in equipment}
    limbs = {segment: pose for segment, pose in poses.items() if segment not in equipment}
    return [*bones(limbs, {joint.child: joint.parent for joint in body.tree_joints}), *equipment_lines(poses, ends)]


@dataclass(frozen=True, eq=False)
class ObliqueView:
    """Screen axes in a world whose z is up.

    Attributes:
        right: (3,) unit vector to the right.
        up: (3,) unit vector upwards on the screen.
    """

    right: Array
    up: Array

    @classmethod
    def of_path(cls, world_T_root: Array) -> "ObliqueView":
        """The view of a root's path (T, 4, 4) [m], which goes to the right."""
        ground = world_T_root[:, :2, 3]
        centred = ground - ground.mean(axis=0)
        _, _, directions = np.linalg.svd(centred, full_matrices=False)
        along = centred @ directions[0]
        heading = directions[0] * (1.0 if along[-1] >= along[0] else -1.0)
        turn = _TURN_WALKING
        if np.ptp(along) < _STANDING_M:
            heading, turn = world_T_root[:, :2, 0].mean(axis=0), _TURN_STANDING
        azimuth = np.arctan2(heading[1], heading[0]) + turn
        right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return cls(right, np.sin(_ELEVATION) * away + np.cos(_ELEVATION) * np.array([0.0, 0.0, 1.0]))

    def project(self, points: Array) -> Array:
        """Screen positions (..., 2) [m] of points (..., 3) [m]."""
        screen: Array = np.stack([points @ self.right, points @ self.up], axis=-1)
        return screen

    def depth(self, points: Array) -> Array:
        """How far (...) points (..., 3) are from the viewer [m], up to a constant."""
        depth: Array = points @ np.cross(self.up, self.right)
        return depth
