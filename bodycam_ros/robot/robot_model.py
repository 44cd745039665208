"""A robot by its URDF: a floating tree, joint limits, hulls of its links."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.geometry import Array
from bodycam_ros.robot.mapping import RobotMapping

FLOATING = 7
"""Numbers of the root's pose in a configuration: place, then quaternion x y z w; the joints follow."""

_FLOATING_SPEEDS = 6
_TOUCHING_M = 0.02
"""Links closer than this in the N-pose are neighbours without a collision limit."""

_SPACE = 3
_FLAT = 1e-6
"""Least over largest extent of a mesh that is not flat."""

_LIMITED_BY_JOINTS = 3
"""Links within so many joints are kept apart by joint limits; their convex hulls would collide too early."""


class Robot:
    """A robot that can follow a person.

    Args:
        urdf: file of the robot; its packages are searched for above the file and on AMENT_PREFIX_PATH.
        mapping: links that follow.

    Attributes:
        mapping: as given.
        text: of the URDF.
        model: pinocchio's, with a floating base.
        hulls: pinocchio's collision geometry, each mesh replaced by its convex hull.
        pairs: (K, 2) of hulls with a collision limit.
        tree_root: root link of the URDF, which need not be the one that follows the pelvis.
        joint_names: (J,) in the order of a configuration.
        lowest, highest: (J,) limits [rad or m].
        fastest: (J,) limits of their speeds [rad/s or m/s].
        n_pose: (7 + J) configuration in the N-pose, the root at the origin.

    Raises:
        BodyError: no URDF, a mesh is missing or flat, a link or joint of the mapping is not there, or cannot be so.
    """

    def __init__(self, urdf: Path, mapping: RobotMapping) -> None:
        pin = _pinocchio()
        self.mapping, self.text = mapping, read_text(urdf, "URDF", BodyError)
        try:
            self.model, self.hulls = pin.buildModelsFromUrdf(
                str(urdf),
                package_dirs=list(_package_folders(urdf)),
                root_joint=pin.JointModelFreeFlyer(),
                geometry_types=[pin.GeometryType.COLLISION],
            )
        except (ValueError, RuntimeError) as error:
            raise BodyError(f"{urdf}: cannot be read as a robot: {error}") from error
        self.tree_root = next(str(f.name) for f in self.model.frames if f.type == pin.FrameType.BODY)
        self.joint_names = tuple(self.model.names[2:])
        self._check(urdf)
        self.lowest = np.asarray(self.model.lowerPositionLimit[FLOATING:], np.float64)
        self.highest = np.asarray(self.model.upperPositionLimit[FLOATING:], np.float64)
        speeds = np.asarray(self.model.velocityLimit[_FLOATING_SPEEDS:], np.float64)
        self.fastest = np.where(speeds > 0.0, speeds, np.inf)
        self.n_pose = self._n_pose()
        self._data = self.model.createData()
        pin.framesForwardKinematics(self.model, self._data, self.n_pose)
        self.pairs = self._hulls_apart()

    def link_in_n_pose(self, link: str) -> Array:
        """root_T_link (4, 4) in the N-pose [m]."""
        placed = [self._data.oMf[self.model.getFrameId(name)].homogeneous for name in (self.mapping.root, link)]
        pose: Array = np.linalg.inv(placed[0]) @ placed[1]
        return pose

    def _check(self, urdf: Path) -> None:
        """Refuse a robot without the mapped links, or with joints of several degrees of freedom."""
        path = self.mapping.path
        if missing := [link for link in self.mapping.links if not self.model.existFrame(link)]:
            raise BodyError(f"{path}: {urdf.name} has no link {', '.join(missing)}")
        if missing := [joint for joint in self.mapping.n_pose if joint not in self.joint_names]:
            raise BodyError(f"{path}: n_pose: {urdf.name} has no joint {', '.join(missing)}")
        for name, joint in zip(self.model.names[2:], self.model.joints[2:], strict=True):
            if joint.nq != 1:
                raise BodyError(f"{urdf}: joint {name} turns for ever or has several angles; give it limits")
        if flat := [hull.name for hull in self.hulls.geometryObjects if _is_flat(hull.geometry)]:
            raise BodyError(f"{urdf}: the collision mesh of {', '.join(flat)} is flat; give it a thickness, or a box")

    def _n_pose(self) -> Array:
        """The configuration in the N-pose."""
        joints = np.clip(np.zeros(len(self.joint_names)), self.lowest, self.highest)
        for joint, angle in self.mapping.n_pose.items():
            row = self.joint_names.index(joint)
            low, high = float(self.lowest[row]), float(self.highest[row])
            if not low <= angle <= high:
                raise BodyError(
                    f"{self.mapping.path}: n_pose: {joint} turns from {low:g} to {high:g}, so not to {angle:g}"
                )
            joints[row] = angle
        return np.concatenate([[0.0] * 6, [1.0], joints])

    def _hulls_apart(self) -> NDArray[np.int64]:
        """(K, 2) hulls of different links that are apart in the N-pose; meshes become hulls."""
        import coal
        import pinocchio as pin

        for hull in self.hulls.geometryObjects:
            if isinstance(hull.geometry, coal.BVHModelBase):
                hull.geometry.buildConvexHull(True, "Qt")
                hull.geometry = hull.geometry.convex
            hull.geometry.computeLocalAABB()
        self.hulls.addAllCollisionPairs()
        data = pin.GeometryData(self.hulls)
        pin.computeDistances(self.model, self.model.createData(), self.hulls, data, self.n_pose)
        chains = [set(self.model.supports[hull.parentJoint]) for hull in self.hulls.geometryObjects]
        apart = [
            (pair.first, pair.second)
            for pair, result in zip(self.hulls.collisionPairs, data.distanceResults, strict=True)
            if result.min_distance > _TOUCHING_M and len(chains[pair.first] ^ chains[pair.second]) > _LIMITED_BY_JOINTS
        ]
        self.hulls.removeAllCollisionPairs()
        for each in apart:
            self.hulls.addCollisionPair(pin.CollisionPair(*each))
        return np.array(apart, np.int64).reshape(-1, 2)


def _is_flat(shape: Any) -> bool:
    """Whether a shape is a mesh in a plane, whose hull would crash coal."""
    if not hasattr(shape, "num_vertices"):
        return False
    corners = np.array([shape.vertex(row) for row in range(shape.num_vertices)]).reshape(-1, 3)
    spread = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False) if len(corners) > _SPACE else np.zeros(1)
    return bool(spread[-1] <= _FLAT * spread[0])


def _pinocchio() -> Any:
    try:
        import coal  # noqa: F401
        import pink  # noqa: F401
        import pinocchio
    except ImportError as error:
        raise BodyError(
            f"a robot needs {error.name}, which is not installed; install it: pip install pin pin-pink daqp"
        ) from error
    return pinocchio


def _package_folders(urdf: Path) -> Iterator[str]:
    """Where ``package://NAME`` may be: any folder above the URDF, and the packages of ROS."""
    yield from map(str, urdf.resolve().parents)
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield str(Path(prefix) / "share")


class JointBounds:
    """A limit of pink: joints within their ranges and speeds since the previous state.

    Args:
        robot: with the limits.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        count, speeds = len(robot.joint_names), robot.model.nv
        select = np.eye(speeds)[speeds - count :]
        self._G = np.vstack([select, -select])
        self._low, self._high = robot.lowest, robot.highest

    def set_previous(self, q: Array, dt_s: float) -> None:
        """Set the previous configuration (7 + J) and the time since [s]."""
        joints, way = q[FLOATING:], dt_s * self._robot.fastest
        self._low = np.maximum(self._robot.lowest, joints - way)
        self._high = np.minimum(self._robot.highest, joints + way)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """G (2 J, V) and h (2 J,) of G dq <= h, at a configuration of pink."""
        joints = configuration.q[FLOATING:]
        return self._G, np.concatenate([np.maximum(self._high - joints, 0.0), np.maximum(joints - self._low, 0.0)])
