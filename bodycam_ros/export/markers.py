"""Virtual markers: points on the segments, for programs that know markers alone.

Each segment has one at the joint that it hangs on, named as the joint; the root's is named as the root. Two more are
half-way along it, in front and at the outer side, so that three tell how it is turned. Segments that carry no other
have one at their tip.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from bodycam_ros.calibration.anatomy import RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.export.sampled_motion import SampledMotion
from bodycam_ros.export.tips import bone_tip
from bodycam_ros.geometry import Array, transform_points

_ASIDE_M = 0.06  # as far as skin is from the middle of a limb


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


def markers_on(motion: SampledMotion) -> list[Marker]:
    """The markers of a body, without equipment.

    Raises:
        BodyError: two would have the same name.
    """
    body, found = motion.body, []
    for segment in motion.people:
        joint = body.joint_to_parent(segment)
        below = [j for j in body.tree_joints if j.parent == segment and j.child in motion.people]
        children = [j.parent_T_joint[:3, 3] for j in below]
        end = max(children, key=lambda at: float(np.linalg.norm(at))) if children else bone_tip(body, segment)
        front = _across(end, np.array([1.0, 0.0, 0.0]))
        side = np.array([0.0, -1.0 if SegmentName(segment).side == RIGHT else 1.0, 0.0])
        found.append(Marker(joint.name if joint else segment, segment, np.zeros(3)))
        found.append(Marker(f"{segment}_front", segment, end / 2.0 + _ASIDE_M * front))
        found.append(Marker(f"{segment}_side", segment, end / 2.0 + _ASIDE_M * side))
        if not children:
            found.append(Marker(f"{segment}_tip", segment, end))
    if twice := sorted(name for name, count in Counter(marker.name for marker in found).items() if count > 1):
        raise BodyError(f"two markers would be named {', '.join(twice)}; rename the joint or segment")
    return found


def marker_places(motion: SampledMotion, markers: list[Marker]) -> Array:
    """(T, M, 3) where markers are [m], in our axes."""
    return np.stack(
        [transform_points(motion.poses_of(marker.segment), marker.at[None])[:, 0] for marker in markers], axis=1
    )


def _across(end: Array, forward: Array) -> Array:
    """The direction across a bone that is nearest to forward; upward of a bone that points forward."""
    along = end / max(float(np.linalg.norm(end)), 1e-9)
    across: Array = forward - (forward @ along) * along
    length = float(np.linalg.norm(across))
    return across / length if length > 0.5 else np.array([0.0, 0.0, 1.0])
