"""Node ``humans``: the solver's body in, the same as a human of REP-155 out, and what that cannot say of it."""

import time
import uuid
from collections import defaultdict
from collections.abc import Sequence
from functools import partial

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor

from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.humans.human_urdf import check_id, human_urdf
from bodycam_ros.humans.kinematic_model import BODY
from bodycam_ros.humans.projection import HumanSkeleton
from bodycam_ros.messages.body import joint_state_message, transforms_message
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import MAP_FRAME, header_message
from bodycam_ros.messages.status import Health, HealthLevel, text_message
from bodycam_ros.nodes.humans_parameters import DESCRIPTION, HumansParameters
from bodycam_ros.nodes.message_classes import TRANSFORMS, is_installed, node_messages
from bodycam_ros.nodes.qos import OUTPUT_DEPTH, latched, reliable
from bodycam_ros.nodes.qos_overrides import LATCHED_SAID, MOTION_HEARD, MOTION_SAID, TRANSFORMS_SAID
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.nodes.told_body import ToldBody

IDS = "hri_msgs/msg/IdsList"
"""apt has it (ros-jazzy-hri-msgs), ROS 2's wheels do not."""

_TRACKED_EVERY_S, _TRACKED_FOR_S = 0.5, 2.0
_DIGITS = 4  # of an id, beside its letter
_NS_PER_S = 1_000_000_000


class HumansNode(StageNode[HumansParameters]):
    """Publishes beneath /humans/bodies, and where the body is in the map as a transform."""

    def __init__(self, arguments: Sequence[str] = ()) -> None:
        super().__init__("humans", HumansParameters, arguments=arguments)
        self._own_id = f"b{uuid.uuid4().hex[:_DIGITS]}"

    def prepare(self) -> None:
        """Listen to the body, and advertise the human."""
        self._id = self.parameters.body_id or self._own_id
        check_id(self._id)
        bodies = "/humans/bodies"
        self._skeleton: HumanSkeleton | None = None
        self._previous: tuple[int, Array] | None = None
        self._instants, self._heard_s = 0, 0.0
        self._farthest: defaultdict[str, float] = defaultdict(float)
        often = partial(reliable, OUTPUT_DEPTH)
        urdf, states = f"{bodies}/{self._id}/urdf", f"{bodies}/{self._id}/joint_states"
        self._description = self.publisher("std_msgs/msg/String", urdf, latched(), LATCHED_SAID)
        self._states = self.publisher("sensor_msgs/msg/JointState", states, often(), MOTION_SAID)
        # The id keeps the frames of people apart; a prefix would not be the REP's.
        self._unprefixed = node_messages()
        self._tf = self.publisher(TRANSFORMS, "/tf", often(), TRANSFORMS_SAID) if is_installed(TRANSFORMS) else None
        self._tracked = self.publisher(IDS, f"{bodies}/tracked", reliable(1)) if is_installed(IDS) else None
        self._told = ToldBody(self._lay, lambda fault: self.skipped.add("instants skipped", fault))
        self.subscription("std_msgs/msg/String", "robot_description", self._on_body, latched(), even_inactive=True)
        hear_angles, hear_root = self._told.hear_angles, self._told.hear_root
        self.subscription("sensor_msgs/msg/JointState", "joint_states", hear_angles, often(), MOTION_HEARD)
        self.subscription("nav_msgs/msg/Odometry", "odometry", hear_root, often(), MOTION_HEARD)
        if self._tracked is not None:
            self.every(_TRACKED_EVERY_S, self._say_tracked)

    def pause(self) -> None:
        """Nobody is tracked until the next instant."""
        self._previous, self._heard_s = None, 0.0

    def _on_body(self, message: Message) -> None:
        self._skeleton, self._previous = None, None
        self._told.is_of(None)
        try:
            body = body_from_urdf(message.data)
            skeleton = HumanSkeleton(body)
        except BodyError as error:
            self.skipped.add("bodies skipped", f"robot_description: {error}")
            return
        self._skeleton = skeleton
        self._told.is_of(body)
        text = human_urdf(skeleton, self._id)
        name = f"{DESCRIPTION}{self._id}"
        if self.has_parameter(name):
            self.undeclare_parameter(name)
        descriptor = ParameterDescriptor(description="URDF of the human, as REP-155 wants it")
        # A dump of the node has that of the body that it heard then.
        self.declare_parameter(name, text, descriptor, ignore_override=True)
        self._description.publish(text_message(self.make, text))

    def _lay(self, stamp_ns: int, world_T_segment: Array) -> None:
        if self._skeleton is None:
            return
        if self._previous is not None and stamp_ns <= self._previous[0]:
            self._previous = None  # a recording that began again
        laid = self._skeleton.lay(world_T_segment, None if self._previous is None else self._previous[1])
        speeds = np.zeros_like(laid.angles)
        if self._previous is not None:
            speeds = (laid.angles - self._previous[1]) * _NS_PER_S / (stamp_ns - self._previous[0])
        self._previous = stamp_ns, laid.angles
        names = [f"{name}_{self._id}" for name in self._skeleton.joint_names]
        self._states.publish(joint_state_message(self.make, stamp_ns, names, laid.angles, speeds))
        if self._tf is not None:
            placed = [(MAP_FRAME, f"{BODY}_{self._id}", laid.world_T_body)]
            self._tf.publish(transforms_message(self._unprefixed, stamp_ns, placed))
        self._instants += 1
        self._heard_s = time.monotonic()
        for link, off in laid.off_rad.items():
            self._farthest[f"{link} [deg]"] = max(self._farthest[f"{link} [deg]"], float(np.degrees(off)))
        for link, off in laid.off_m.items():
            self._farthest[f"{link} [cm]"] = max(self._farthest[f"{link} [cm]"], 100.0 * off)

    def _say_tracked(self) -> None:
        is_tracked = time.monotonic() - self._heard_s < _TRACKED_FOR_S
        header = header_message(self.make, self.get_clock().now().nanoseconds, "")
        assert self._tracked is not None  # or there is no timer
        self._tracked.publish(self.make(IDS, header=header, ids=[self._id] if is_tracked else []))

    def health(self) -> list[Health]:
        """How far the human was from the body since the last report, link by link."""
        instants, self._instants = self._instants, 0
        farthest = {f"farthest off: {link}": round(off, 1) for link, off in self._farthest.items()}
        self._farthest.clear()
        values: dict[str, object] = {"instants per second": instants, **farthest, **self.skipped.counts}
        if self._tracked is None:
            values["/humans/bodies/tracked"] = "not published: hri_msgs is not installed"
        part = f"body {self._id}"
        if not instants:
            text = self.skipped.latest if self.skipped.lately() or self._skeleton is None else ""
            return [Health(part, HealthLevel.WARN, text or "nobody to describe: no body is solved", values)]
        return [Health(part, HealthLevel.OK, "described", values)]


def main() -> int:
    """Run the node until it is stopped; its exit code."""
    return run(HumansNode, "humans")
