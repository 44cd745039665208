"""Keeps the links of a robot apart: to first order, no step brings two hulls nearer than they may be.

Beside the nearest points of two hulls, corners that are nearly as near count: feet that turn beside each other would
meet with these.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, hat, transform_points
from bodycam_ros.robot.robot_model import Robot

_NEAR_M = 0.06
"""Hulls farther apart than this meet in no step."""

_BACK_M = 0.005
"""A step takes hulls apart again that have come too near, by so much at most: more might be impossible."""

_SLAB_M = 0.04  # corners so much farther from the other hull than the nearest point count as well


class _Meetings(NamedTuple):
    """Where hulls might meet: pairs (K, 2) of joints, places (K, 3), normals (K, 3) from the first, gaps (K,) [m]."""

    joints: NDArray[np.int64]
    places: Array
    normals: Array
    gaps: Array


class LinksApart:
    """A limit of pink.

    Args:
        robot: whose links are kept apart.
        clearance_m: between hulls.

    Attributes:
        may_stay: whether hulls that are too near already may stay so: where nothing else can be done.
    """

    def __init__(self, robot: Robot, clearance_m: float) -> None:
        import coal
        import pinocchio

        self._coal, self._pin, self._robot, self._clearance_m = coal, pinocchio, robot, clearance_m
        self._data = pinocchio.GeometryData(robot.hulls)
        hulls = robot.hulls.geometryObjects
        self._shapes = [hull.geometry for hull in hulls]
        self._corners = [_corners(shape) for shape in self._shapes]
        self._joints = [hull.parentJoint for hull in hulls]
        self._centres = np.array([shape.aabb_center for shape in self._shapes]).reshape(-1, 3)
        self._radii = np.array([shape.aabb_radius for shape in self._shapes])
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self._known: tuple[Array, _Meetings] | None = None
        self.may_stay = False

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """G (K, V) and h (K,) of G dq <= h, at a configuration of pink; None if no hulls are near each other."""
        meetings = self._meetings(configuration)
        if not len(meetings.gaps):
            return None
        used, rows = np.unique(meetings.joints, return_inverse=True)
        rows = rows.reshape(meetings.joints.shape)
        J = np.array([self._jacobian(configuration, joint) for joint in used.tolist()])[rows]
        origins = np.array([configuration.data.oMi[joint].translation for joint in used.tolist()])[rows]
        # A place p on a link moves by v - (p - o) x w, with v and w of the link's joint at o.
        moves = J[:, :, :3] - hat(meetings.places[:, None] - origins) @ J[:, :, 3:]
        G = np.einsum("ki,kiv->kv", meetings.normals, moves[:, 0] - moves[:, 1])
        return G, np.maximum(meetings.gaps - self._clearance_m, 0.0 if self.may_stay else -_BACK_M)

    def nearest(self, configuration: Any) -> float:
        """Distance of the nearest two hulls [m], negative where they touch; infinite if none are near."""
        return float(self._meetings(configuration).gaps.min(initial=np.inf))

    def _jacobian(self, configuration: Any, joint: int) -> Array:
        """(6, V) of a joint's place and turn in the world's axes, place first."""
        aligned = self._pin.LOCAL_WORLD_ALIGNED
        return np.asarray(self._pin.getJointJacobian(configuration.model, configuration.data, joint, aligned))

    def _meetings(self, configuration: Any) -> _Meetings:
        """Where hulls that are near each other might meet."""
        if self._known is None or not np.array_equal(self._known[0], configuration.q):
            self._known = configuration.q.copy(), self._found(configuration)
        return self._known[1]

    def _found(self, configuration: Any) -> _Meetings:
        self._pin.updateGeometryPlacements(configuration.model, configuration.data, self._robot.hulls, self._data)
        poses = np.array([pose.homogeneous for pose in self._data.oMg]).reshape(-1, 4, 4)
        centres = (poses[:, :3, :3] @ self._centres[..., None])[..., 0] + poses[:, :3, 3]
        first, second = self._robot.pairs.T
        away = np.linalg.norm(centres[first] - centres[second], axis=1) - self._radii[first] - self._radii[second]
        near = self._robot.pairs[away < _NEAR_M]
        placed = {
            row: self._coal.Transform3s(poses[row, :3, :3], poses[row, :3, 3]) for row in np.unique(near).tolist()
        }
        joints, places, normals, gaps = [], [], [], []
        for one, other in near.tolist():
            self._result.clear()
            gap = self._coal.distance(
                self._shapes[one], placed[one], self._shapes[other], placed[other], self._request, self._result
            )
            if gap >= _NEAR_M:
                continue
            normal = np.asarray(self._result.normal)
            ends = self._result.getNearestPoint1(), self._result.getNearestPoint2()
            beside = [
                *_beside(transform_points(poses[one], self._corners[one]), ends[1], normal, gap),
                *_beside(transform_points(poses[other], self._corners[other]), ends[0], -normal, gap),
            ]
            for place, to_other in ((0.5 * (ends[0] + ends[1]), gap), *beside):
                joints.append((self._joints[one], self._joints[other]))
                places.append(place)
                normals.append(normal)
                gaps.append(to_other)
        return _Meetings(
            np.array(joints, np.int64).reshape(-1, 2),
            np.array(places).reshape(-1, 3),
            np.array(normals).reshape(-1, 3),
            np.array(gaps),
        )


def _corners(shape: Any) -> Array:
    """(N, 3) corners of a hull in its own frame [m]; none of what is round."""
    return np.array(shape.points() if hasattr(shape, "points") else []).reshape(-1, 3)


def _beside(corners: Array, other: Array, normal: Array, gap: float) -> list[tuple[Array, float]]:
    """The outermost of the corners (N, 3) that are nearly as near to another hull, and their distances to its face.

    Args:
        corners: in the world [m].
        other: (3,) nearest point of the other hull.
        normal: (3,) towards it.
        gap: between the hulls [m].
    """
    away = (other - corners) @ normal
    slab = np.flatnonzero(away < gap + _SLAB_M)
    if not len(slab):
        return []
    across = np.linalg.svd(normal[None])[2][1:]
    along = corners[slab] @ across.T
    outermost = np.unique([along.argmin(axis=0), along.argmax(axis=0)])
    return [(corners[row], float(away[row])) for row in slab[outermost].tolist()]
