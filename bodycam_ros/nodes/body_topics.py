"""What the solver publishes: the body, and how it moves."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.duration import Duration

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.link_transforms import LinkTransform, LinkTransforms
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.camera.readout import Readout
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.learned_body import SettledLengths, learned_body
from bodycam_ros.messages.body import output_messages, transforms_message
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE
from bodycam_ros.messages.status import text_message
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.nodes.message_classes import TRANSFORMS, is_installed
from bodycam_ros.nodes.parameters import SolverParameters
from bodycam_ros.nodes.qos import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.nodes.qos_overrides import LATCHED_SAID, MOTION_SAID, TRANSFORMS_SAID
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.outside.person_masses import person_masses
from bodycam_ros.solving.body_state import BodyOutput

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

_LAST_WORDS_S = 0.5


class BodyTopics:
    """Publishers of ``robot_description``, once per body, and of the body's motion.

    The description is published a second time, once, when learned lengths of equipment have settled.
    Where the node's parameter ``publish_links`` says so every link of ``robot_description`` is in ``/tf``, or
    ``/tf_static`` if it never moves in its parent; else the root alone, and robot_state_publisher has to add the rest.

    Args:
        node: publishes.
        with_equipment: whether it says how the body is coupled to some.
    """

    def __init__(self, node: StageNode[SolverParameters], with_equipment: bool = False) -> None:
        self._node = node
        self._make = node.make
        self._timings: dict[str, Any] = {}
        self._description = node.publisher("std_msgs/msg/String", "robot_description", latched(), LATCHED_SAID)
        self._outputs = {
            # Transforms are everybody's; the rest moves with the node's namespace.
            topic: node.publisher(
                type_name,
                topic if topic == "/tf" else topic[1:],
                reliable(OUTPUT_DEPTH),
                TRANSFORMS_SAID if topic == "/tf" else MOTION_SAID,
            )
            for topic, type_name in (OUTPUTS | ({EQUIPMENT: EQUIPMENT_TYPE} if with_equipment else {})).items()
            if is_installed(type_name)
        }
        self._links: LinkTransforms | None = None
        self._marked_ns = 0
        has_links = node.parameters.publish_links and is_installed(TRANSFORMS)
        self._fixed_links = node.publisher(TRANSFORMS, _STATIC, latched(), LATCHED_SAID) if has_links else None

    def describe(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        """Publish the body, coupled to equipment if there is some; later subscribers receive it too (latched).

        Raises:
            BodyError: the body has no URDF, or no person's masses fit it.
        """
        self._equipment = equipment
        self._lengths = SettledLengths(equipment) if equipment is not None else None
        self._publish_description(body)
        for camera, mount in body.mounts.items():
            if mount.readout is not None:
                self._publish_timing(camera, mount.readout)

    def _publish_description(self, body: BodyModel) -> None:
        mass_kg = self._node.parameters.mass
        text = urdf_text(body, person_masses(body, mass_kg) if mass_kg > 0.0 else None)
        self._description.publish(text_message(self._make, text))
        if self._fixed_links is not None:
            # Of the text that others read, so that they and we say the same of every link.
            before, self._links = self._links, LinkTransforms(text)
            if before is None or not _same_links(before.fixed, self._links.fixed):
                now_ns = self._node.get_clock().now().nanoseconds
                self._fixed_links.publish(transforms_message(self._make, now_ns, self._links.fixed))

    def _describe_learned(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish the description again if the lengths of the equipment have settled."""
        report = output.state.equipment
        if self._lengths is None or self._equipment is None or report is None:
            return
        values = self._lengths.add(output.state.stamp_ns, report)
        if values is not None:
            self._publish_description(learned_body(body, self._equipment, values))

    def _publish_timing(self, camera: str, readout: Readout) -> None:
        """Tell those who register the camera how long its rows are read out."""
        if camera not in self._timings:
            self._timings[camera] = self._node.publisher("bodycam_msgs/msg/CameraTiming", f"{camera}/timing", latched())
        self._timings[camera].publish(timing_message(self._make, camera, SaidTiming(0, "body", readout)))

    def publish(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish where the body is at one instant."""
        self._describe_learned(output, body)
        links = self._links.moving(output.joint_names, output.positions) if self._links is not None else ()
        messages = output_messages(self._make, output, body, links)
        for topic, message in messages.items():
            if topic in self._outputs and (topic != _MARKERS or self._are_markers_due(output.state.stamp_ns)):
                self._outputs[topic].publish(message)

    def _are_markers_due(self, stamp_ns: int) -> bool:
        rate_hz, passed_ns = self._node.parameters.marker_rate, stamp_ns - self._marked_ns
        if not rate_hz or 0 <= passed_ns < 1e9 / rate_hz - _ROUNDING_NS:
            return False
        self._marked_ns = stamp_ns
        return True

    def wait_until_heard(self) -> None:
        """Give the readers the time to get the last messages, but all together no more than half a second."""
        deadline_s = time.monotonic() + _LAST_WORDS_S
        for publisher in self._outputs.values():
            left_s = max(0.0, deadline_s - time.monotonic())
            publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left_s)))


def _same_links(some: Sequence[LinkTransform], others: Sequence[LinkTransform]) -> bool:
    return len(some) == len(others) and all(
        one[:2] == other[:2] and np.array_equal(one[2], other[2]) for one, other in zip(some, others, strict=True)
    )
