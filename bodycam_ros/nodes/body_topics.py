"""Topics of the solver: the body's description and its motion."""

import time
from collections import deque

from rclpy.duration import Duration

from bodycam_ros.body.average_person import person_masses
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import SettledLengths, learned_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.urdf import LinkTransforms, urdf_text
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.graph.unobserved_joints import UnobservedJoints
from bodycam_ros.messages.body import (
    EQUIPMENT,
    EQUIPMENT_TYPE,
    joint_state_message,
    output_messages,
    transforms_message,
)
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.nodes.moments import Moment
from bodycam_ros.nodes.parameters import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.nodes.stage_node import Stage

_TRANSFORMS = "tf2_msgs/msg/TFMessage"

OUTPUTS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/joint_rotations": "sensor_msgs/msg/MultiDOFJointState",
    "/joint_covariances": "bodycam_msgs/msg/JointCovariances",
    "/odometry": "nav_msgs/msg/Odometry",
    "/tf": _TRANSFORMS,
    "/skeleton": "visualization_msgs/msg/MarkerArray",
}
"""Topic -> type of the messages of ``output_messages``."""

_POLL_S = 0.004
_LAST_MESSAGES_S = 0.5

_LEAST_SHARE = 0.6
"""Share of the time between two stamps that lies at least between their messages."""

_MOST_WAITING = 3
"""More frames wait if a recording is played faster than it was recorded; then none is delayed."""

_LONGEST_S = 0.1


class BodyTopics:
    """Publishers of ``robot_description``, once per body, and of the body's motion.

    The description is published once more when the estimated lengths of equipment have settled. With the parameter
    ``publish_links`` every link of ``robot_description`` is in ``/tf``, or in ``/tf_static`` if it never moves in its
    parent; else the root alone, and robot_state_publisher adds the others.

    Args:
        stage: publishes.
        with_equipment: whether the coupling to equipment is published.
    """

    def __init__(self, stage: Stage[SolverParameters], with_equipment: bool = False) -> None:
        self._stage, self._make = stage, stage.make
        # Frames are solved in bursts, as images arrive; consumers of joint states want them evenly spaced.
        self._waiting: deque[tuple[BodyOutput, BodyModel]] = deque()
        self._published_ns, self._due_s = 0, 0.0
        self._timer = stage.every(_POLL_S, self._poll, even_inactive=True)
        self._timer.cancel()  # until a state waits
        self._description = stage.publisher("std_msgs/msg/String", "robot_description", latched())
        self._outputs = {
            # /tf is global; the other topics are in the node's namespace.
            topic: stage.publisher(
                type_name, topic if topic == "/tf" else topic[1:], reliable(OUTPUT_DEPTH), overridable=True
            )
            for topic, type_name in (OUTPUTS | ({EQUIPMENT: EQUIPMENT_TYPE} if with_equipment else {})).items()
        }
        self._unobserved = UnobservedJoints(stage.parameters.unobserved_joints)
        self._links: LinkTransforms | None = None
        has_links = stage.parameters.publish_links
        self._fixed_links = stage.publisher(_TRANSFORMS, "/tf_static", latched()) if has_links else None

    def describe(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        """Publish the description of the body, with equipment if there is any (latched).

        Raises:
            BodyError: the body has no URDF, or no person's masses fit it.
        """
        self._equipment = equipment
        self._lengths = SettledLengths(equipment) if equipment is not None else None
        self._publish_description(body)

    def publish(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish a state of the body, with a delay if the one before has just been published."""
        self._waiting.append((output, body))
        self._poll()
        if self._waiting and self._timer.is_canceled():
            self._timer.reset()

    def finish(self) -> None:
        """Publish the states that wait, and give the readers half a second to receive them."""
        while self._waiting:
            self._publish_next()
        deadline_s = time.monotonic() + _LAST_MESSAGES_S
        for publisher in self._outputs.values():
            left_s = max(0.0, deadline_s - time.monotonic())
            publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left_s)))

    def _publish_description(self, body: BodyModel) -> None:
        mass_kg = self._stage.parameters.mass
        text = urdf_text(body, person_masses(body, mass_kg) if mass_kg > 0.0 else None)
        self._description.publish(text_message(self._make, text))
        if self._fixed_links is not None:
            self._links = LinkTransforms(body)
            now_ns = self._stage.node.get_clock().now().nanoseconds
            self._fixed_links.publish(transforms_message(self._make, now_ns, self._links.fixed))

    def _update_description(self, output: BodyOutput, body: BodyModel) -> None:
        """Publish the description again if the lengths of the equipment have settled."""
        report = output.state.equipment
        if self._lengths is None or self._equipment is None or report is None:
            return
        values = self._lengths.add(output.state.stamp_ns, report)
        if values is not None:
            self._publish_description(learned_body(body, self._equipment, values))

    def _poll(self) -> None:
        """Publish the states that are due."""
        while self._waiting and (len(self._waiting) > _MOST_WAITING or time.monotonic() >= self._due_s):
            self._publish_next()
        if not self._waiting:
            self._timer.cancel()

    def _publish_next(self) -> None:
        output, body = self._waiting.popleft()
        stamp_ns = output.state.stamp_ns
        passed_s = min(1e-9 * max(stamp_ns - self._published_ns, 0), _LONGEST_S)
        self._published_ns, self._due_s = stamp_ns, time.monotonic() + _LEAST_SHARE * passed_s
        self._update_description(output, body)
        links = self._links.moving(output.joint_names, output.positions) if self._links is not None else ()
        messages = output_messages(self._make, output, body, links)
        joints = self._unobserved.joint_states(output, body)
        messages["/joint_states"] = joint_state_message(self._make, stamp_ns, *joints)
        for topic, message in messages.items():
            if topic in self._outputs:
                self._outputs[topic].publish(message)
        self._stage.moments.note(Moment.SOLVED, "", stamp_ns)
