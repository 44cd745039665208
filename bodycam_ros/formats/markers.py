"""Virtual markers: points on the segments, for programs that know markers alone.

Each segment has one at the joint that it hangs on, named as the joint; the root's is named as the root. Two more are
half-way along it, in front and at the outer side, so that three tell how it is turned. Segments that carry no other
have one at their tip.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import JOINT_RADIUS_M, BodyModel, Mass
from bodycam_ros.calibration.anthropometry import RIGHT, SegmentName
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.formats.tips import bone_tip
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces

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


_DENSITY = 1000.0  # [kg / m^3]
_BALL_KG = _DENSITY * 4.0 / 3.0 * np.pi * JOINT_RADIUS_M**3


def masses(body: BodyModel) -> dict[str, Mass]:
    """Segment -> its mass; one without a surface has that of a ball at its joint."""
    found = {segment: _of_mesh(surface.vertices[surface.faces]) for segment, surface in capsule_surfaces(body).items()}
    ball = Mass(_BALL_KG, np.zeros(3), 0.4 * _BALL_KG * JOINT_RADIUS_M**2 * np.eye(3))
    return {segment: found.get(segment, ball) for segment in body.segments}


def _of_mesh(corners: Array) -> Mass:
    """Of closed parts whose faces have corners (F, 3, 3), by the tetrahedra to the origin.

    The second moment of a tetrahedron with a corner at the origin is V / 20 (sum of c c' + s s'), with s the sum of its
    other corners c.
    """
    volumes = np.linalg.det(corners) / 6.0
    sums = corners.sum(axis=1)
    volume = float(volumes.sum())
    centre = (volumes @ sums) / (4.0 * volume)
    moments = np.einsum("f,fki,fkj->ij", volumes, corners, corners) + np.einsum("f,fi,fj->ij", volumes, sums, sums)
    about_centre = _DENSITY * (moments / 20.0 - volume * np.outer(centre, centre))
    return Mass(_DENSITY * volume, centre, np.trace(about_centre) * np.eye(3) - about_centre)
