"""Subscriber of a live graph's body, for ``bodycam view --live``."""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.live.joint_state_synchronizer import JointStateSynchronizer
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.poses import pose_and_covariance
from bodycam_ros.nodes.parameters import OUTPUT_DEPTH, latched, message_class, reliable
from bodycam_ros.nodes.process import ignore_discovery
from bodycam_ros.viewer.live_session import LiveInstant

_SPIN_S = 0.2
_POSES = 60
"""Poses of a camera that are stored: the solver publishes a frame after its images."""


class BodyListener:
    """A node that receives the body on a thread of its own.

    Args:
        on_body: called with the URDF of each description of a body.
        on_instant: called with each complete frame.
        namespace: of the graph.

    Raises:
        ViewError: the middleware does not admit the node, or the namespace is invalid.
    """

    def __init__(
        self, on_body: Callable[[str], None], on_instant: Callable[[LiveInstant], None], namespace: str = ""
    ) -> None:
        self._on_instant = on_instant
        states = JointStateSynchronizer(self._combine, on_fault=lambda text: None)
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
        self._subscribe("std_msgs/msg/String", "robot_description", lambda message: on_body(message.data), latched())
        self._subscribe("sensor_msgs/msg/JointState", "joint_states", states.add_joint_state, quality)
        self._subscribe("nav_msgs/msg/Odometry", "odometry", states.add_odometry, quality)
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def watch(self, cameras: Iterable[str]) -> None:
        """Receive the poses of these cameras too."""
        new = [camera for camera in cameras if camera not in self._poses]
        # A new table, for the other thread may iterate over this one.
        self._poses = self._poses | {camera: deque(maxlen=_POSES) for camera in new}
        for camera in new:
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self._subscribe(kind, f"{camera}/pose", partial(self._add_pose, camera), reliable(OUTPUT_DEPTH))

    def stop(self) -> None:
        """Leave the graph."""
        self._is_stopped.set()
        self._thread.join()
        ignore_discovery(self._node)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _subscribe(self, kind: str, topic: str, receive: Callable[[Any], None], quality: Any) -> None:
        def receive_valid(message: Any) -> None:
            # Other nodes may publish other messages on such topics.
            with suppress(ValueError):
                receive(message)

        self._node.create_subscription(message_class(kind), topic, receive_valid, quality)

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        while not self._is_stopped.is_set():
            executor.spin_once(_SPIN_S)
        executor.remove_node(self._node)

    def _add_pose(self, camera: str, message: Any) -> None:
        self._poses[camera].append((stamp_ns(message.header.stamp), pose_and_covariance(message.pose)[0]))

    def _combine(self, stamp: int, names: tuple[str, ...], angles: Array, world_T_root: Array) -> None:
        poses = {camera: tuple(sorted(known, key=lambda one: one[0])) for camera, known in self._poses.items()}
        self._on_instant(LiveInstant(stamp, names, angles, world_T_root, poses))
