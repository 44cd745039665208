"""Where every link of a URDF is in its parent: the frames that robot_state_publisher makes of it and joint states."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf_document import UrdfDocument
from bodycam_ros.geometry import Array, exp_se3

LinkTransform = tuple[str, str, Array]
"""Parent link, child link, parent_T_child (4, 4) [m]."""


class LinkTransforms:
    """The links of a URDF, apart from its root.

    Args:
        text: the document.

    Attributes:
        fixed: those that never move in their parent: cameras, and what is welded.

    Raises:
        BodyError: it is not a URDF.
    """

    def __init__(self, text: str) -> None:
        joints = UrdfDocument.parse(text).joints
        self.fixed: tuple[LinkTransform, ...] = tuple(
            (joint.parent, joint.child, joint.parent_T_joint) for joint in joints if joint.axis is None
        )
        self._joints = tuple(joint for joint in joints if joint.axis is not None)
        self._twists = np.array([joint.twist for joint in self._joints]).reshape(-1, 6)
        self._parent_T_joint = np.array([joint.parent_T_joint for joint in self._joints]).reshape(-1, 4, 4)

    def moving(self, names: Sequence[str], positions: NDArray[np.float64]) -> list[LinkTransform]:
        """Those that move.

        Args:
            names: J joints, all that move among them.
            positions: (J,) angles [rad], or places [m] of joints that slide.

        Raises:
            KeyError: a joint that moves is not among them.
        """
        row = {name: number for number, name in enumerate(names)}
        rows = np.array([row[joint.name] for joint in self._joints], dtype=int)
        parent_T_child = self._parent_T_joint @ exp_se3(positions[rows, None] * self._twists)
        return [(joint.parent, joint.child, pose) for joint, pose in zip(self._joints, parent_T_child, strict=True)]
