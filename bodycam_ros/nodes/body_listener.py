"""Hears what the running graph says of the body: its description, where it is, which cameras know where they are."""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.messages.body_instants import AnglesAndRoot
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.pose import pose_and_covariance
from bodycam_ros.nodes.message_classes import message_class
from bodycam_ros.nodes.process import ignore_discovery
from bodycam_ros.nodes.qos import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.view.live_body import LiveInstant

_SPIN_S = 0.2
_KEPT = 60
"""Poses of a camera: the solver tells of an instant after its images."""


class BodyListener:
    """A node that listens on a thread of its own.

    Args:
        on_body: called with a URDF when the graph describes a body, or describes it anew.
        on_instant: called when all of an instant has been heard.
        namespace: of the graph.

    Raises:
        ViewError: the middleware lets it hear nothing, or the namespace is none.
    """

    def __init__(
        self, on_body: Callable[[str], None], on_instant: Callable[[LiveInstant], None], namespace: str = ""
    ) -> None:
        self._on_instant = on_instant
        told = AnglesAndRoot(self._tell, on_fault=lambda text: None)
        self._poses: dict[str, deque[tuple[int, NDArray[np.float64]]]] = {}
        self._context = rclpy.Context()
        try:
            rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
            self._node = rclpy.create_node("bodycam_view", namespace=namespace, context=self._context)
        except (rclpy_implementation.RCLError, NameValidationException) as error:
            # DDS does not let it take part, as it lacks keys, or the namespace is none.
            self._context.try_shutdown()
            raise ViewError(f"--live: the graph cannot be heard: {' '.join(str(error).split())}") from error
        self._listen("std_msgs/msg/String", "robot_description", lambda message: on_body(message.data), latched())
        self._listen("sensor_msgs/msg/JointState", "joint_states", told.hear_angles, reliable(OUTPUT_DEPTH))
        self._listen("nav_msgs/msg/Odometry", "odometry", told.hear_root, reliable(OUTPUT_DEPTH))
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def watch(self, cameras: Iterable[str]) -> None:
        """Hear from now on where these cameras find themselves."""
        fresh = [camera for camera in cameras if camera not in self._poses]
        # Another table, for the thread that hears may be going through this one.
        self._poses = self._poses | {camera: deque(maxlen=_KEPT) for camera in fresh}
        for camera in fresh:
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self._listen(kind, f"{camera}/pose", partial(self._hear_camera, camera), reliable(OUTPUT_DEPTH))

    def stop(self) -> None:
        """Leave the graph."""
        self._is_stopped.set()
        self._thread.join()
        ignore_discovery(self._node)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _listen(self, kind: str, topic: str, hear: Callable[[Any], None], quality: Any) -> None:
        def heard(message: Any) -> None:
            # Others publish on such topics, too: joint states without positions are theirs, and no reason to end.
            with suppress(ValueError):
                hear(message)

        self._node.create_subscription(message_class(kind), topic, heard, quality)

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        while not self._is_stopped.is_set():
            executor.spin_once(_SPIN_S)
        executor.remove_node(self._node)

    def _hear_camera(self, camera: str, message: Any) -> None:
        pose = pose_and_covariance(message.pose)[0]
        self._poses[camera].append((stamp_ns(message.header.stamp), pose))

    def _tell(self, stamp: int, names: tuple[str, ...], angles: NDArray[np.float64], root: Array) -> None:
        poses = {camera: tuple(sorted(heard, key=lambda one: one[0])) for camera, heard in self._poses.items()}
        self._on_instant(LiveInstant(stamp, names, angles, root, poses))
