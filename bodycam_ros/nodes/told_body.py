"""Where the segments of a body are at an instant that the solver tells."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.nodes.angles_and_root import AnglesAndRoot


class ToldBody(AnglesAndRoot):
    """Hears joint states and odometry of one body.

    Args:
        on_pose: called with the stamp [ns] and world_T_segment (S, 4, 4) [m] of every instant.
        on_fault: called with what is wrong with a message.
    """

    def __init__(self, on_pose: Callable[[int, Array], None], on_fault: Callable[[str], None]) -> None:
        super().__init__(self._place, on_fault)
        self._on_pose, self._on_fault = on_pose, on_fault
        self._body: BodyModel | None = None

    def is_of(self, body: BodyModel | None) -> None:
        """What is told from now on is of this body; None: of nobody known."""
        self._body = body
        self._joint_angles = None if body is None else JointAngles(body)
        self.forget()

    def _place(self, stamp: int, names: tuple[str, ...], angles: NDArray[np.float64], root: Array) -> None:
        if self._body is None or self._joint_angles is None:
            return
        told = dict(zip(names, angles.tolist(), strict=True))
        if missing := [name for name in self._joint_angles.names if name not in told]:
            self._on_fault(f"joint_states lacks {missing[0]}; is it of another robot_description?")
            return
        ours = np.array([told[name] for name in self._joint_angles.names])
        if not (np.isfinite(ours).all() and np.isfinite(root).all()):
            self._on_fault(f"joint_states or odometry at {stamp} ns is not finite")
            return
        self._on_pose(stamp, self._body.forward_kinematics(root, self._joint_angles.poses(ours)))
