"""Where the links of a published robot are, by an independent reader of URDF and forward kinematics: Pinocchio."""

from typing import Any

import numpy as np
import pinocchio

from bodycam_ros.geometry import Array


class StockConsumer:
    """A consumer of /robot_description and /joint_states that has nothing of this package.

    Args:
        urdf: text of the description.
    """

    def __init__(self, urdf: str) -> None:
        self._model = pinocchio.buildModelFromXML(urdf)
        self._data = self._model.createData()

    def links(self, joint_state: Any) -> dict[str, Array]:
        """Link -> root_T_link (4, 4) by a sensor_msgs/JointState."""
        q = pinocchio.neutral(self._model)
        assert len(joint_state.name) == self._model.njoints - 1
        for name, angle in zip(joint_state.name, joint_state.position, strict=True):
            joint = self._model.joints[self._model.getJointId(name)]
            # A joint without limits is kept as cosine and sine.
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.framesForwardKinematics(self._model, self._data, q)
        return {
            frame.name: self._data.oMf[number].homogeneous
            for number, frame in enumerate(self._model.frames)
            if frame.type == pinocchio.FrameType.BODY
        }
