"""Subscriber of a live graph's body, for ``bodycam view --live``."""

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import body_from_urdf
from bodycam_ros.errors import BodyError, ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.graph.joint_state_synchronizer import JointStateSynchronizer
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.factory import Message, stamp_ns
from bodycam_ros.messages.poses import pose_and_covariance
from bodycam_ros.nodes.parameters import OUTPUT_DEPTH, latched, message_class, reliable
from bodycam_ros.nodes.process import ignore_discovery, spin
from bodycam_ros.viewer.motion import Motion, in_order

_POSES = 60
"""Poses of a camera that are stored: the solver publishes a frame after its images."""


class BodyListener:
    """A node that receives the body on a thread of its own.

    Args:
        on_body: called with each body that is described, or the reason why a description cannot be read.
        on_state: called with the body described last and each complete state of it.
        namespace: of the graph.

    Raises:
        ViewError: the middleware does not admit the node, or the namespace is invalid.
    """

    def __init__(
        self,
        on_body: Callable[[BodyModel | str], None],
        on_state: Callable[[BodyModel, Motion], None],
        namespace: str = "",
    ) -> None:
        self._on_body, self._on_state = on_body, on_state
        self._states = JointStateSynchronizer(self._combine, on_fault=lambda text: None)
        self._body: BodyModel | None = None
        self._poses: dict[str, deque[tuple[int, Array]]] = {}
        self._context = rclpy.Context()
        try:
            rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
            self._node = rclpy.create_node("bodycam_view", namespace=namespace, context=self._context)
        except (rclpy_implementation.RCLError, NameValidationException) as error:
            # Without keys DDS does not admit the node, or the namespace is invalid.
            self._context.try_shutdown()
            raise ViewError(f"--live: cannot connect to the graph: {' '.join(str(error).split())}") from error
        quality = reliable(OUTPUT_DEPTH)
        self._subscribe("std_msgs/msg/String", "robot_description", self._describe, latched())
        self._subscribe("sensor_msgs/msg/JointState", "joint_states", self._states.add_joint_state, quality)
        self._subscribe("nav_msgs/msg/Odometry", "odometry", self._states.add_odometry, quality)
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=spin, args=(self._node, self._is_stopped.is_set), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Leave the graph."""
        self._is_stopped.set()
        self._thread.join()
        ignore_discovery(self._node)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _subscribe(self, kind: str, topic: str, receive: Callable[[Any], None], quality: Any) -> None:
        def receive_valid(message: Message) -> None:
            # Other nodes may publish other messages on such topics.
            with suppress(ValueError):
                receive(message)

        self._node.create_subscription(message_class(kind), topic, receive_valid, quality)

    def _describe(self, message: Message) -> None:
        try:
            self._body = body = body_from_urdf(message.data)
        except BodyError as error:
            self._on_body(f"/robot_description cannot be read: {error}")
            return
        self._states.set_body(body)
        self._on_body(body)
        for camera in body.mounts.keys() - self._poses.keys():
            self._poses[camera] = deque(maxlen=_POSES)
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self._subscribe(kind, f"{camera}/pose", partial(self._add_pose, camera), reliable(OUTPUT_DEPTH))

    def _add_pose(self, camera: str, message: Message) -> None:
        self._poses[camera].append((stamp_ns(message.header.stamp), pose_and_covariance(message.pose)[0]))

    def _combine(self, stamp: int, angles: Array, world_T_root: Array) -> None:
        assert self._body is not None
        registered = {camera: in_order(dict(self._poses[camera])) for camera in self._body.mounts}
        names = JointAngles(self._body).names
        state = Motion(np.array([stamp]), world_T_root[None], names, angles[None], registered)
        self._on_state(self._body, state)
