"""Images, camera_info and inertial samples of a driver, with the quality of service that it offers; cameras' timing."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import LensError
from bodycam_ros.files.shown import printable
from bodycam_ros.messages.factory import Message, stamp_ns
from bodycam_ros.messages.images import INFO, INFO_TYPE, camera_model
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_row_of_cdr
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, UNKNOWN_CLOCK, timing_message
from bodycam_ros.nodes.gathered_lines import GatheredLines
from bodycam_ros.nodes.parameters import best_effort, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

_INFO_DEPTH = 10
_SENSOR_DEPTH = 1000  # 1 s of a fast one
_QUIET_S = 1.5
_PATIENCE_S = 2.0
"""The publisher of the preferred form may take a while to be discovered."""

Quality = Callable[[int], QoSProfile]
"""Quality of service with some depth."""


class TopicForm(NamedTuple):
    """A form in which a driver may publish: type, topic, and what is called with each message."""

    kind: str
    topic: str
    receive: Callable[[Message], None]


class DriverTopic:
    """A subscription to what a driver publishes, in its form and with its quality of service.

    It is the first form's, and reliable, at first. While no message comes it becomes best effort, or latched, if the
    publishers offer no more; where there are none, it becomes another form's that is published.

    Args:
        stage: uses the messages.
        forms: in order of preference.
        depth: messages that may wait in the subscription.
        overridable: whether users can override its quality of service.
        even_inactive: whether messages are received while the node is inactive.
    """

    def __init__(
        self,
        stage: Stage[Any],
        forms: Sequence[TopicForm],
        depth: int,
        overridable: bool = False,
        even_inactive: bool = False,
    ) -> None:
        self._stage = stage
        self._forms = forms
        self._depth = depth
        self._overridable, self._even_inactive = overridable, even_inactive
        self._started_s = time.monotonic()
        self._latest_s = self._started_s - _QUIET_S
        self._subscribe(forms[0], reliable, overridable)
        stage.watch(self._poll)

    @property
    def quiet_s(self) -> float:
        """Time since the latest message [s]."""
        return time.monotonic() - self._latest_s

    def explain(self, what: str) -> str:
        """Why no message arrives, as far as is known."""
        topic = self._form.topic
        if offered_quality(self._stage, topic) is not None:
            return f"no {what} on {topic}, though it is published"
        reason = f"no {what}: no node publishes {self._stage.node.resolve_topic_name(topic)}"
        if elsewhere := self._published_elsewhere(topic):
            reason += f"; {elsewhere} is published: start driver and graph in the same namespace"
        return reason

    def _published_elsewhere(self, topic: str) -> str | None:
        """The full name of a published topic of this name in another namespace, if there is one."""
        node = self._stage.node
        names = sorted(name for name, _ in node.get_topic_names_and_types() if name.endswith(f"/{topic}"))
        return next((name for name in names if node.count_publishers(name)), None)

    def _subscribe(self, form: TopicForm, quality: Quality, overridable: bool) -> None:
        self._form, self._quality = form, quality
        self._subscription = self._stage.subscription(
            form.kind,
            form.topic,
            partial(self._receive, form),
            quality(self._depth),
            overridable=overridable,
            even_inactive=self._even_inactive,
            adapts=True,
        )

    def _receive(self, form: TopicForm, message: Message) -> None:
        self._latest_s = time.monotonic()
        form.receive(message)

    def _poll(self) -> None:
        """Adapt to what is published while no message arrives."""
        if self.quiet_s < _QUIET_S:
            return
        form, quality = self._form, offered_quality(self._stage, self._form.topic)
        if quality is None and time.monotonic() - self._started_s >= _PATIENCE_S:
            for form in self._forms:
                if (quality := offered_quality(self._stage, form.topic)) is not None:
                    self._stage.log.info(f"no node publishes {self._form.topic}; reads {form.topic}")
                    break
        if quality is None or (form is self._form and quality is self._quality):
            return
        if quality is best_effort:
            text = f"{form.topic}, and perhaps others, is published with best effort: messages may get lost"
            self._stage.log.warning(text, once=True)
        self._stage.node.destroy_subscription(self._subscription)
        # A user's override is for the first subscription to a topic: rclpy would apply it to the second too.
        self._subscribe(form, quality, self._overridable and form is not self._form)


def offered_quality(stage: Stage[Any], topic: str) -> Quality | None:
    """Quality of service that all publishers of a topic offer, by depth; None without publishers."""
    node = stage.node
    offers = [info.qos_profile for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))]
    if any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers):
        return best_effort
    if offers and all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers):
        return latched
    return reliable if offers else None


class CameraModels:
    """Models of some cameras by their camera_info; the latest counts.

    Args:
        stage: uses the models.
        cameras: their names.
        on_change: called when a camera's model is known, changes, or is rejected.
        on_info: called with the camera and the stamp [ns] of each camera_info.
        logs: whether to log what is wrong, of all cameras in one line. The solver does: it reads every camera_info,
            and sixteen trackers would log sixteen lines; all nodes have it in their diagnostics.

    A camera whose camera_info is unusable is not used until it sends one that is not. An unusable one that comes after
    a usable one changes nothing: anybody may have published it.

    Attributes:
        models: camera -> its model.
        rejected: camera -> why its camera_info is unusable; the text does not name the camera.
        changes: how often a model became another.
    """

    def __init__(
        self,
        stage: Stage[Any],
        cameras: Iterable[str],
        on_change: Callable[[str], None],
        on_info: Callable[[str, int], None] = lambda camera, stamp_ns: None,
        logs: bool = False,
    ) -> None:
        self._lines = GatheredLines(stage) if logs else None
        self._on_change = on_change
        self._on_info = on_info
        self._contents: dict[str, tuple[Any, ...]] = {}
        self.models: dict[str, CameraModel] = {}
        self.rejected: dict[str, str] = {}
        self._warned: set[str] = set()
        self.changes = 0
        self._cameras = tuple(cameras)
        for camera in self._cameras:
            form = TopicForm(INFO_TYPE, f"{camera}{INFO}", partial(self._update, camera))
            # While a node is inactive, too: a driver may publish it only once.
            DriverTopic(stage, [form], _INFO_DEPTH, even_inactive=True)

    @property
    def missing(self) -> list[str]:
        """Cameras without camera_info so far."""
        return [camera for camera in self._cameras if camera not in self._contents]

    def _update(self, camera: str, message: Message) -> None:
        self._on_info(camera, stamp_ns(message.header.stamp))
        roi = message.roi
        part = (roi.x_offset, roi.y_offset, roi.width, roi.height, message.binning_x, message.binning_y)
        content = (message.width, message.height, message.distortion_model, *part, tuple(message.d), tuple(message.k))
        before = self._contents.get(camera)
        if content == before:
            return
        try:
            self.models[camera] = camera_model(message, camera)
            self._contents[camera] = content
        except LensError as error:
            if camera in self.models:
                if camera not in self._warned:
                    self._warned.add(camera)
                    self._warn(f"{printable(str(error))}; the camera_info before it is used (reported once)")
                return
            self._contents[camera] = content
            reason = printable(error.cause)
            if reason != self.rejected.get(camera) and self._lines is not None:
                line = f"camera {camera}: {reason}; the camera is not used until its driver sends a usable camera_info"
                self._lines.errors.append(line)
            self.rejected[camera] = reason
        else:
            self.rejected.pop(camera, None)
            if before is not None:
                self.changes += 1
                self._warn(f"camera {camera}: its camera_info has changed; restart")
        self._on_change(camera)

    def _warn(self, line: str) -> None:
        if self._lines is not None:
            self._lines.warnings.append(line)


def subscribe_sensor(stage: Stage[Any], camera: str, receive: Callable[[int, tuple[float, ...]], object]) -> None:
    """Call a function with each sample of a camera's inertial sensor: its stamp [ns] and reading."""
    sampled = IMU_TYPE, f"{camera}{IMU_TOPIC}", lambda sample: receive(*sample), best_effort(_SENSOR_DEPTH)
    stage.subscription(*sampled, imu_row_of_cdr, "inertial samples dropped", adapts=True, raw=True)


class CameraTimings:
    """Publishers of ``<camera>/timing``, in the camera's own stamps.

    Args:
        stage: publishes.
        cameras: names.
    """

    def __init__(self, stage: Stage[Any], cameras: Iterable[str]) -> None:
        self._make = stage.make
        self._histories: dict[str, ClockHistory] = {}
        # Read-out time of the body file, and clock: late subscribers need both.
        self._publishers = {each: stage.publisher(TIMING_TYPE, f"{each}{TIMING}", latched(2)) for each in cameras}

    def set_body(self, body: BodyModel) -> None:
        """Publish what a body, the first or another, has of the cameras' read-out times."""
        for camera, readout in body.readout_starts.items():
            self._publish(camera, readout)

    def publish_clocks(self, histories: Mapping[str, ClockHistory]) -> None:
        """Publish the clocks that have changed; each is valid from the stamp of its estimate."""
        for camera, history in histories.items():
            if history != self._histories.get(camera):
                self._histories[camera] = history
                now = replace(history.latest, since_ns=max(history.latest.since_ns, history.latest.at_ns))
                # Without the read-out time, which the registration would count twice.
                self._publish(camera, None, now)

    def _publish(self, camera: str, readout: Readout | None, clock: ClockState = UNKNOWN_CLOCK) -> None:
        if camera in self._publishers:
            self._publishers[camera].publish(timing_message(self._make, camera, "body", readout, clock))
