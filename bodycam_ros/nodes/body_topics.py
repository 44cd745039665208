"""What the solver publishes: the body, and how it moves."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import SettledLengths, learned_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.urdf import LinkTransforms, urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.live.flow_of_frames import Paced
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.messages.body import AnglesAndRoot, output_messages, transforms_message
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.health import EQUIPMENT, EQUIPMENT_TYPE, text_message
from bodycam_ros.messages.tracks import pose_and_covariance
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.parameters import OUTPUT_DEPTH, TRANSFORMS, is_installed, latched, message_class, reliable
from bodycam_ros.nodes.process import ignore_discovery
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.static_cameras.person_model import person_masses
from bodycam_ros.viewer.live_session import LiveInstant

OUTPUTS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joint_rotations": "sensor_msgs/msg/MultiDOFJointState",
    "/joint_covariances": "bodycam_msgs/msg/JointCovariances",
    "/odometry": "nav_msgs/msg/Odometry",
    "/tf": TRANSFORMS,
    "/skeleton": "visualization_msgs/msg/MarkerArray",
}
"""Topic -> type of what ``output_messages`` makes."""

_STATIC, _MARKERS = "/tf_static", "/skeleton"

_ROUNDING_NS = 1_000_000
"""Of stamps: every second instant of 30 Hz is one of 15 Hz."""

_STEP_S = 0.004
_LAST_WORDS_S = 0.5


class BodyTopics:
    """Publishers of ``robot_description``, once per body, and of the body's motion.

    The description is published a second time, once, when learned lengths of equipment have settled.
    Where the node's parameter ``publish_links`` says so every link of ``robot_description`` is in ``/tf``, or
    ``/tf_static`` if it never moves in its parent; else the root alone, and robot_state_publisher has to add the rest.

    Args:
        stage: publishes.
        with_equipment: whether it says how the body is coupled to some.
    """

    def __init__(self, stage: Stage[SolverParameters], with_equipment: bool = False) -> None:
        self._stage, self._make = stage, stage.make
        # Instants are solved in bursts, as images come. Who consumes joint states wants them evenly spaced.
        self._paced: Paced[tuple[BodyOutput, BodyModel]] = Paced(self._publish)
        stage.every(_STEP_S, self._paced.look, even_inactive=True)
        self._description = stage.publisher("std_msgs/msg/String", "robot_description", latched())
        self._outputs = {
            # Transforms are everybody's; the rest moves with the node's namespace.
            topic: stage.publisher(
                type_name, topic if topic == "/tf" else topic[1:], reliable(OUTPUT_DEPTH), overridable=True
            )
            for topic, type_name in (OUTPUTS | ({EQUIPMENT: EQUIPMENT_TYPE} if with_equipment else {})).items()
            if is_installed(type_name)
        }
        self._links: LinkTransforms | None = None
        self._marked_ns = 0
        has_links = stage.parameters.publish_links and is_installed(TRANSFORMS)
        self._fixed_links = stage.publisher(TRANSFORMS, _STATIC, latched()) if has_links else None

    def describe(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        """Publish the body, coupled to equipment if there is some; later subscribers receive it too (latched).

        Raises:
            BodyError: the body has no URDF, or no person's masses fit it.
        """
        self._equipment = equipment
        self._lengths = SettledLengths(equipment) if equipment is not None else None
        self._publish_description(body)

    def _publish_description(self, body: BodyModel) -> None:
        mass_kg = self._stage.parameters.mass
        text = urdf_text(body, person_masses(body, mass_kg) if mass_kg > 0.0 else None)
        self._description.publish(text_message(self._make, text))
        if self._fixed_links is not None:
            # Of the text that others read, so that they and we say the same of every link.
            self._links = LinkTransforms(text)
            now_ns = self._stage.node.get_clock().now().nanoseconds
            self._fixed_links.publish(transforms_message(self._make, now_ns, self._links.fixed))

    def _describe_learned(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish the description again if the lengths of the equipment have settled."""
        report = output.state.equipment
        if self._lengths is None or self._equipment is None or report is None:
            return
        values = self._lengths.add(output.state.stamp_ns, report)
        if values is not None:
            self._publish_description(learned_body(body, self._equipment, values))

    def publish(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish where the body is at one instant; not at once where the one before has only just been published."""
        self._paced.add(output.state.stamp_ns, (output, body))

    def _publish(self, instant: tuple[BodyOutput, BodyModel]) -> None:
        output, body = instant
        stamp_ns = output.state.stamp_ns
        self._describe_learned(output, body)
        links = self._links.moving(output.joint_names, output.positions) if self._links is not None else ()
        for topic, message in output_messages(self._make, output, body, links).items():
            if topic in self._outputs and (topic != _MARKERS or self._are_markers_due(stamp_ns)):
                self._outputs[topic].publish(message)
        self._stage.moments.note(Moment.SOLVED, "", stamp_ns)

    def _are_markers_due(self, stamp_ns: int) -> bool:
        rate_hz, passed_ns = self._stage.parameters.marker_rate, stamp_ns - self._marked_ns
        if not rate_hz or 0 <= passed_ns < 1e9 / rate_hz - _ROUNDING_NS:
            return False
        self._marked_ns = stamp_ns
        return True

    def finish(self) -> None:
        """Publish what waits, and give the readers half a second to receive it."""
        self._paced.flush()
        deadline_s = time.monotonic() + _LAST_WORDS_S
        for publisher in self._outputs.values():
            left_s = max(0.0, deadline_s - time.monotonic())
            publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left_s)))


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
