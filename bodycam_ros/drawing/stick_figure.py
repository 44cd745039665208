"""The lines that a body is drawn with."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, transform_points

_TIPS_M = {
    "head": (0.0, 0.0, 0.20),
    "forearm": (0.0, 0.0, -0.25),
    "hand": (0.0, 0.0, -0.15),
    "foot": (0.17, 0.0, -0.06),
}
"""Where a last segment ends, for the eye only: nobody measures fingertips, toes and the crown."""

HEAD = "head"


@dataclass(frozen=True, eq=False)
class Bone:
    """A line over T instants.

    Attributes:
        segment: that it belongs to.
        start, end: (T, 3) [m].
    """

    segment: str
    start: Array
    end: Array


def bones(world_T_segment: Mapping[str, Array], parents: Mapping[str, str]) -> list[Bone]:
    """A line from the origin of each segment to that of each child, and to the tips of the last ones.

    Args:
        world_T_segment: segment -> (T, 4, 4) [m].
        parents: segment -> the segment that it hangs on.
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
    """The same of a body whose segments are at poses (S, 4, 4), at one instant."""
    poses = dict(zip(body.segments, world_T_segment[:, None], strict=True))
    return bones(poses, {joint.child: joint.parent for joint in body.tree_joints})
