"""Images, camera_info and inertial samples of a driver, with the quality of service that it offers; cameras' timing."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import LensError, SettingsError
from bodycam_ros.messages.factory import Message, stamp_ns
from bodycam_ros.messages.images import INFO, INFO_TYPE, TRANSPORTS, camera_model
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_row_of_cdr
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, UNKNOWN_CLOCK, timing_message
from bodycam_ros.nodes.parameters import best_effort, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

_INFO_DEPTH = 10
_SENSOR_DEPTH = 1000  # 1 s of a fast one
_POLL_S = 0.5
_QUIET_S = 1.5
_PATIENCE_S = 2.0
"""The publisher of the wanted transport may take a while to be discovered."""


class DriverTopic:
    """A subscription to a topic of a driver, with the quality of service that its publishers offer.

    It is reliable at first; ``adapt`` makes it best effort, or latched, if the driver offers no more.

    Args:
        stage: uses the messages.
        kind, topic: type and name.
        receive: called with each message.
        depth: messages that may wait in the subscription.
        overridable: whether users can override its quality of service.
        even_inactive: whether messages are received while the node is inactive.
    """

    def __init__(
        self,
        stage: Stage[Any],
        kind: str,
        topic: str,
        receive: Callable[[Message], None],
        depth: int,
        overridable: bool = False,
        even_inactive: bool = False,
    ) -> None:
        self._stage, self.topic, self._quality = stage, topic, reliable
        self._subscribe = partial(stage.subscription, kind, topic, receive, even_inactive=even_inactive, adapts=True)
        self._depth = depth
        self._subscription = self._subscribe(reliable(depth), overridable=overridable)

    def adapt(self) -> bool:
        """Subscribe again if the publishers offer another quality; whether there are publishers."""
        offers = offered_qualities(self._stage, self.topic)
        if any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers):
            quality = best_effort
        elif offers and all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers):
            quality = latched
        else:
            quality = reliable
        if offers and quality is not self._quality:
            if quality is best_effort:
                self._stage.log.warning(f"{self.topic} is published with best effort: messages may get lost")
            self.close()
            # A user's override is for the first subscription: rclpy would apply it to the second too.
            self._quality, self._subscription = quality, self._subscribe(quality(self._depth))
        return bool(offers)

    def close(self) -> None:
        """End the subscription."""
        self._stage.node.destroy_subscription(self._subscription)


def offered_qualities(stage: Stage[Any], topic: str) -> list[QoSProfile]:
    """Quality of service of all publishers of a topic."""
    node = stage.node
    return [info.qos_profile for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))]


class ImageSource:
    """Subscribes to a camera's images.

    Args:
        stage: uses the images.
        camera: its name.
        transport: of ``TRANSPORTS``; another one is used if it alone is published.
        depth: images that may wait in the subscription.
        on_image: called with each message and its transport.

    Raises:
        SettingsError: there is no such transport here.
    """

    def __init__(
        self, stage: Stage[Any], camera: str, transport: str, depth: int, on_image: Callable[[Message, str], None]
    ) -> None:
        if transport not in TRANSPORTS:
            known = ", ".join(TRANSPORTS)
            raise SettingsError(f"the parameter 'transport' must be one of {known}, not '{transport}'")
        self._stage, self._camera, self._depth, self._on_image = stage, camera, depth, on_image
        self._source = self._subscribe(transport)
        self._started_s = time.monotonic()
        self._latest_s = self._started_s - _QUIET_S
        stage.every(_POLL_S, self._poll)

    @property
    def quiet_s(self) -> float:
        """Time since the last image [s]."""
        return time.monotonic() - self._latest_s

    def explain(self) -> str:
        """Why no image arrives, as far as is known."""
        topic = self._source.topic
        if offered_qualities(self._stage, topic):
            return f"no image on {topic}, though it is published"
        return f"no image: no node publishes {topic}"

    def _subscribe(self, transport: str) -> DriverTopic:
        of, receive = TRANSPORTS[transport], partial(self._receive, transport)
        topic = f"{self._camera}{of.ending}"
        return DriverTopic(self._stage, of.kind, topic, receive, self._depth, overridable=True)

    def _receive(self, transport: str, message: Message) -> None:
        self._latest_s = time.monotonic()
        self._on_image(message, transport)

    def _poll(self) -> None:
        """Adapt to what is published while no image arrives."""
        if self.quiet_s < _QUIET_S or self._source.adapt() or time.monotonic() - self._started_s < _PATIENCE_S:
            return
        for transport, of in TRANSPORTS.items():
            topic = f"{self._camera}{of.ending}"
            if topic != self._source.topic and offered_qualities(self._stage, topic):
                self._stage.log.info(f"no node publishes {self._source.topic}; reads {topic}")
                self._source.close()
                self._source = self._subscribe(transport)
                return


class CameraModels:
    """Models of some cameras by their camera_info; the latest counts.

    Args:
        stage: uses the models.
        cameras: their names.
        on_change: called when a camera's model is known, changes, or is rejected.
        on_info: called with the stamp of each camera_info [ns].
        fatal: whether an unusable camera_info ends the node; otherwise the camera is not used.

    Attributes:
        models: camera -> its model.
        rejected: cameras whose camera_info is unusable.
        changes: how often a model became another.
    """

    def __init__(
        self,
        stage: Stage[Any],
        cameras: Iterable[str],
        on_change: Callable[[str], None],
        on_info: Callable[[int], None] = lambda stamp_ns: None,
        fatal: bool = False,
    ) -> None:
        self._log, self._on_change, self._on_info, self._fatal = stage.log, on_change, on_info, fatal
        self._contents: dict[str, tuple[Any, ...]] = {}
        self.models: dict[str, CameraModel] = {}
        self.rejected: set[str] = set()
        self.changes = 0
        self._sources = {
            # While a node is inactive, too: a driver may publish it only once.
            camera: DriverTopic(
                stage, INFO_TYPE, f"{camera}{INFO}", partial(self._update, camera), _INFO_DEPTH, even_inactive=True
            )
            for camera in cameras
        }
        stage.every(_POLL_S, self._poll, even_inactive=True)

    @property
    def missing(self) -> list[str]:
        """Cameras without camera_info so far."""
        return [camera for camera in self._sources if camera not in self._contents]

    def _poll(self) -> None:
        for camera in self.missing:
            self._sources[camera].adapt()

    def _update(self, camera: str, message: Message) -> None:
        self._on_info(stamp_ns(message.header.stamp))
        content = (message.width, message.height, message.distortion_model, tuple(message.d), tuple(message.k))
        before = self._contents.get(camera)
        if content == before:
            return
        self._contents[camera] = content
        try:
            self.models[camera] = camera_model(message, camera)
        except LensError as error:
            if self._fatal:
                raise
            self.models.pop(camera, None)
            self.rejected.add(camera)
            self._log.error(f"{error}; the other cameras go on without this one")
        else:
            self.rejected.discard(camera)
            if before is not None:
                self.changes += 1
                self._log.warning(f"camera {camera}: its camera_info has changed; restart")
        self._on_change(camera)


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
