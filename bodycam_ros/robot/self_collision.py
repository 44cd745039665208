"""Limit against self-collision of a robot: to first order, no step brings two hulls nearer than their clearance.

Besides the nearest points of two hulls, corners at nearly the same distance count: feet that rotate beside each other
would collide there.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, hat, transform_points
from bodycam_ros.robot.robot_model import Robot

_NEAR_M = 0.06
"""Hulls farther apart than this do not collide in a step."""

_BACK_M = 0.005
"""Largest increase per step of a distance below the clearance: more might be infeasible."""

_SLAB_M = 0.04  # corners so much farther from the other hull than the nearest point count as well


class _Contacts(NamedTuple):
    """Possible contacts: pairs (K, 2) of joints, positions (K, 3), normals (K, 3) from the first, gaps (K,) [m]."""

    joints: NDArray[np.int64]
    positions: Array
    normals: Array
    gaps: Array


class SelfCollisionLimit:
    """A limit of pink.

    Args:
        robot: with the hulls.
        clearance_m: between hulls.

    Attributes:
        allows_contact: whether hulls below the clearance may stay there, if no other step is feasible.
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
        self._known: tuple[Array, _Contacts] | None = None
        self.allows_contact = False

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """G (K, V) and h (K,) of G dq <= h, at a configuration of pink; None if no hulls are near each other."""
        contacts = self._contacts(configuration)
        if not len(contacts.gaps):
            return None
        used, rows = np.unique(contacts.joints, return_inverse=True)
        rows = rows.reshape(contacts.joints.shape)
        J = np.array([self._jacobian(configuration, joint) for joint in used.tolist()])[rows]
        origins = np.array([configuration.data.oMi[joint].translation for joint in used.tolist()])[rows]
        # A point p on a link moves by v - (p - o) x w, with v and w of the link's joint at o.
        moves = J[:, :, :3] - hat(contacts.positions[:, None] - origins) @ J[:, :, 3:]
        G = np.einsum("ki,kiv->kv", contacts.normals, moves[:, 0] - moves[:, 1])
        return G, np.maximum(contacts.gaps - self._clearance_m, 0.0 if self.allows_contact else -_BACK_M)

    def nearest(self, configuration: Any) -> float:
        """Distance of the nearest two hulls [m], negative where they touch; infinite if none are near."""
        return float(self._contacts(configuration).gaps.min(initial=np.inf))

    def _jacobian(self, configuration: Any, joint: int) -> Array:
        """(6, V) Jacobian of a joint's position and rotation in the world's axes, position first."""
        aligned = self._pin.LOCAL_WORLD_ALIGNED
        return np.asarray(self._pin.getJointJacobian(configuration.model, configuration.data, joint, aligned))

    def _contacts(self, configuration: Any) -> _Contacts:
        """Possible contacts of near hulls."""
        if self._known is None or not np.array_equal(self._known[0], configuration.q):
            self._known = configuration.q.copy(), self._find_contacts(configuration)
        return self._known[1]

    def _find_contacts(self, configuration: Any) -> _Contacts:
        self._pin.updateGeometryPlacements(configuration.model, configuration.data, self._robot.hulls, self._data)
        poses = np.array([pose.homogeneous for pose in self._data.oMg]).reshape(-1, 4, 4)
        centres = (poses[:, :3, :3] @ self._centres[..., None])[..., 0] + poses[:, :3, 3]
        first, second = self._robot.pairs.T
        away = np.linalg.norm(centres[first] - centres[second], axis=1) - self._radii[first] - self._radii[second]
        near = self._robot.pairs[away < _NEAR_M]
        placed = {
            row: self._coal.Transform3s(poses[row, :3, :3], poses[row, :3, 3]) for row in np.unique(near).tolist()
        }
        joints, positions, normals, gaps = [], [], [], []
        for one, other in near.tolist():
            self._result.clear()
            gap = self._coal.distance(
                self._shapes[one], placed[one], self._shapes[other], placed[other], self._request, self._result
            )
            if gap >= _NEAR_M:
                continue
            normal = np.asarray(self._result.normal)
            ends = self._result.getNearestPoint1(), self._result.getNearestPoint2()
            corners = [
                *_outer_corners(transform_points(poses[one], self._corners[one]), ends[1], normal, gap),
                *_outer_corners(transform_points(poses[other], self._corners[other]), ends[0], -normal, gap),
            ]
            for place, to_other in ((0.5 * (ends[0] + ends[1]), gap), *corners):
                joints.append((self._joints[one], self._joints[other]))
                positions.append(place)
                normals.append(normal)
                gaps.append(to_other)
        return _Contacts(
            np.array(joints, np.int64).reshape(-1, 2),
            np.array(positions).reshape(-1, 3),
            np.array(normals).reshape(-1, 3),
            np.array(gaps),
        )


def _corners(shape: Any) -> Array:
    """(N, 3) corners of a hull in its own frame [m]; none of what is round."""
    return np.array(shape.points() if hasattr(shape, "points") else []).reshape(-1, 3)


def _outer_corners(corners: Array, other: Array, normal: Array, gap: float) -> list[tuple[Array, float]]:
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
