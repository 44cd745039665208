"""The solver's topics in tests of nodes that read them: the sample's person."""

from typing import Any

import numpy as np

from bodycam_ros.results.solved_body import SolvedBody


class SolverPublisher:
    """Publishes the topics of the solver for the sample's person."""

    def __init__(self, graph: Any, solved: SolvedBody) -> None:
        from bodycam_ros.nodes.parameters import latched, node_messages

        self._solved, self._make = solved, node_messages()
        self._described = graph.publisher("/robot_description", "std_msgs/msg/String", latched())
        self._angles = graph.publisher("/joint_states", "sensor_msgs/msg/JointState")
        self._root = graph.publisher("/odometry", "nav_msgs/msg/Odometry")

    def has_readers(self) -> bool:
        return all(each.get_subscription_count() for each in (self._described, self._angles, self._root))

    def describe(self, text: str) -> None:
        from bodycam_ros.messages.diagnostics import text_message

        self._described.publish(text_message(self._make, text))

    def publish(self, row: int, **angles: float) -> None:
        """Publish one state; ``angles`` of joints by name replace those that were solved."""
        from bodycam_ros.messages.body import joint_state_message
        from bodycam_ros.messages.factory import MAP_FRAME, header_message
        from bodycam_ros.messages.poses import pose_with_covariance_message

        motion = self._solved
        stamp, root = int(motion.stamps_ns[row]), motion.world_T_root[row]
        known = dict(zip(motion.joint_names, motion.joint_angles[row].tolist(), strict=True)) | angles
        positions = np.array(list(known.values()))
        self._angles.publish(joint_state_message(self._make, stamp, list(known), positions, np.zeros(len(known))))
        pose = pose_with_covariance_message(self._make, root, np.eye(6))
        header = header_message(self._make, stamp, MAP_FRAME)
        self._root.publish(self._make("nav_msgs/msg/Odometry", header=header, child_frame_id="pelvis", pose=pose))
