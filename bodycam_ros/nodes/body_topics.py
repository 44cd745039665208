"""What the solver publishes: the body, and how it moves."""

import time

from rclpy.duration import Duration

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.link_transforms import LinkTransforms
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.learned_body import SettledLengths, learned_body
from bodycam_ros.live.node_parameters import SolverParameters
from bodycam_ros.live.pacing import Paced
from bodycam_ros.messages.body import output_messages, transforms_message
from bodycam_ros.messages.equipment import EQUIPMENT, EQUIPMENT_TYPE
from bodycam_ros.messages.status import text_message
from bodycam_ros.moments import Moment
from bodycam_ros.nodes.message_classes import TRANSFORMS, is_installed
from bodycam_ros.nodes.qos import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.outside.person_masses import person_masses

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
