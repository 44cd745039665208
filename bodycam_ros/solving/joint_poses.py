"""How all joints of a body would be closed at once, each as ``Joint.measured_relative_pose`` has it."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, rigid

Array = NDArray[np.float64]


class JointPoses:
    """The joints (J) of a body, tree and loops alike, in the order of ``BodyModel.joints``.

    Args:
        body: segments and joints.

    Attributes:
        ends: (J, 2) rows of parent and child among the segments.
    """

    def __init__(self, body: BodyModel) -> None:
        self.ends = np.array(
            [(body.segment_index[joint.parent], body.segment_index[joint.child]) for joint in body.joints], int
        ).reshape(-1, 2)
        self._on_parent = np.array([joint.parent_T_joint[:3, 3] for joint in body.joints]).reshape(-1, 3)
        self._on_child = np.array([joint.child_T_joint[:3, 3] for joint in body.joints]).reshape(-1, 3)
        # Balls keep whatever rotation they have; the others say for themselves what they permit.
        self._others = [(row, joint) for row, joint in enumerate(body.joints) if joint.type != "ball"]

    def closed(self, world_T_segment: Array) -> Array:
        """Poses (J, 4, 4) of children in their parents that close the joints of segments (S, 4, 4)."""
        parents, children = self.ends.T
        parent_T_child = inverse(world_T_segment[parents]) @ world_T_segment[children]
        R = parent_T_child[:, :3, :3]
        measured = rigid(R, self._on_parent - (R @ self._on_child[:, :, None])[:, :, 0])
        for row, joint in self._others:
            measured[row] = joint.measured_relative_pose(parent_T_child[row])
        return measured
