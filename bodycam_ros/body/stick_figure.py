"""The lines that a body is drawn with."""

from collections.abc import Mapping
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

    def at(self, state: int) -> "Bone":
        """The line at one state."""
        row = slice(state, state + 1)
        return replace(self, start=self.start[row], end=self.end[row])


def limb_bones(world_T_segment: Mapping[str, Array], parents: Mapping[str, str]) -> list[Bone]:
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


def body_bones(body: BodyModel, world_T_segment: Array) -> list[Bone]:
    """The lines of a body and its equipment at poses (S, 4, 4), or (S, T, 4, 4) over T states [m]."""
    poses = world_T_segment if world_T_segment.ndim == 4 else world_T_segment[:, None]
    world_T = dict(zip(body.segments, poses, strict=True))
    equipment = {segment: world_T.pop(segment) for segment in body.segments if segment in body.equipment_segments}
    lines = limb_bones(world_T, {joint.child: joint.parent for joint in body.tree_joints})
    # A last segment whose tip is unknown, as the shin of legs alone, is drawn as far as its cameras reach.
    drawn = {line.segment for line in lines}
    for segment, each in world_T.items():
        if segment not in drawn:
            tip = next(iter(bone_ends(body, segment)), np.zeros(3))
            lines.append(Bone(segment, each[:, :3, 3], transform_points(each, tip[None])[:, 0]))
    for segment, each in equipment.items():
        ends = (transform_points(each, end[None])[:, 0] for end in bone_ends(body, segment))
        lines += [Bone(segment, each[:, :3, 3], end, is_equipment=True) for end in ends]
    return lines
