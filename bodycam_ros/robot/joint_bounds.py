"""Limits of a robot's joints and of their speeds, for the steps of one instant."""

from typing import Any

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.robot.robot_model import FLOATING, Robot


class JointBounds:
    """A limit of pink: what joints may reach from where they were at the instant before.

    Args:
        robot: whose limits are kept.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        count, speeds = len(robot.joint_names), robot.model.nv
        select = np.eye(speeds)[speeds - count :]
        self._G = np.vstack([select, -select])
        self._low, self._high = robot.lowest, robot.highest

    def begin(self, q: Array, dt_s: float) -> None:
        """The instant before had the configuration (7 + J), so many seconds ago."""
        joints, way = q[FLOATING:], dt_s * self._robot.fastest
        self._low = np.maximum(self._robot.lowest, joints - way)
        self._high = np.minimum(self._robot.highest, joints + way)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
        """G (2 J, V) and h (2 J,) of G dq <= h, at a configuration of pink."""
        joints = configuration.q[FLOATING:]
        return self._G, np.concatenate([np.maximum(self._high - joints, 0.0), np.maximum(joints - self._low, 0.0)])
