"""Virtual markers: points on the segments, for programs that know markers alone.

Each segment has one at the joint to its parent, named as the joint; the root's is named as the root. Two more are
half-way along it, in front and at the outer side, so that three define its rotation. Segments without children have one
at their tip.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body import average_person
from bodycam_ros.body.body_model import BodyModel, bone_ends, sole_points
from bodycam_ros.body.segment_name import RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.geometry import Array, transform_points

_ASIDE_M = 0.06  # as far as skin is from the middle of a limb
_SHORT_M = 0.1  # length of a segment of which nothing is known


@dataclass(frozen=True, eq=False)
class Marker:
    """One marker.

    Attributes:
        name: unique in a body.
        segment: that carries it.
        at: (3,) in the segment's frame [m].
    """

    name: str
    segment: str
    at: Array


def place_markers(motion: SampledMotion) -> list[Marker]:
    """The markers of a body, without equipment.

    Raises:
        BodyError: two would have the same name.
    """
    body, markers = motion.body, []
    for segment in motion.body_segments:
        joint = body.joint_to_parent(segment)
        below = [j for j in body.tree_joints if j.parent == segment and j.child in motion.body_segments]
        children = [j.parent_T_joint[:3, 3] for j in below]
        end = max(children, key=lambda at: float(np.linalg.norm(at))) if children else bone_tip(body, segment)
        side = np.array([0.0, -1.0 if SegmentName(segment).side == RIGHT else 1.0, 0.0])
        markers.append(Marker(joint.name if joint else segment, segment, np.zeros(3)))
        markers.append(Marker(f"{segment}_front", segment, end / 2.0 + _ASIDE_M * _front(end)))
        markers.append(Marker(f"{segment}_side", segment, end / 2.0 + _ASIDE_M * side))
        if not children:
            markers.append(Marker(f"{segment}_tip", segment, end))
    if twice := sorted(name for name, count in Counter(marker.name for marker in markers).items() if count > 1):
        raise BodyError(f"two markers would be named {', '.join(twice)}; rename the joint or segment")
    return markers


def marker_positions(motion: SampledMotion, markers: list[Marker]) -> Array:
    """(T, M, 3) of markers [m], in our axes."""
    return np.stack(
        [transform_points(motion.segment_poses(marker.segment), marker.at[None])[:, 0] for marker in markers], axis=1
    )


def bone_tip(body: BodyModel, segment: str) -> Array:
    """(3,) end of a segment without children, in its frame [m]; crown and toes by the proportions of people."""
    kind, stature = SegmentName(segment).kind, average_person.stature_of(body)
    if kind == "head":
        return np.array([0.0, 0.0, average_person.NECK_TO_VERTEX * stature])
    if kind == "foot":
        ball: Array = sole_points(average_person.BONES["shin"] * stature)[1]
        return ball
    length = average_person.HAND_LENGTH if kind == "hand" else average_person.BONES.get(kind)
    if length is not None:
        return np.array([0.0, 0.0, -length * stature])
    ends = bone_ends(body, segment)
    return ends[0] if ends else np.array([0.0, 0.0, _SHORT_M])


def _front(end: Array) -> Array:
    """The direction across a bone that is nearest to forward; upward of a bone that points forward."""
    along = end / max(float(np.linalg.norm(end)), 1e-9)
    forward = np.array([1.0, 0.0, 0.0])
    across: Array = forward - (forward @ along) * along
    length = float(np.linalg.norm(across))
    return across / length if length > 0.5 else np.array([0.0, 0.0, 1.0])
