"""Images and camera_info of a camera's driver, with the quality of service that it offers; timing of a camera."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import VideoMode
from bodycam_ros.errors import LensError, SettingsError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import camera_model
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE, CameraTiming, timing_message, timing_messages
from bodycam_ros.nodes.parameters import best_effort, is_installed, latched, reliable
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_state import ClockHistory

_INFO = "sensor_msgs/msg/CameraInfo"
TRANSPORTS = {
    "compressed": ("image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
    "raw": ("image_raw", "sensor_msgs/msg/Image"),
    "video": ("image_raw/compressed_video", COMPRESSED_VIDEO),
    "foxglove": ("image_raw/foxglove", COMPRESSED_VIDEO),
}
"""Transports of images: topic of a camera, and type."""

_INFO_DEPTH = 10
_POLL_S = 0.5
_QUIET_S = 1.5
_PATIENCE_S = 2.0
"""The publisher of the wanted transport may take a while to be discovered."""


class ImageSource:
    """Subscribes to a camera's images: reliable, or best effort if the driver offers no more.

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
        if not is_installed(TRANSPORTS[transport][1]):
            raise SettingsError(f"the transport '{transport}' needs the ROS package foxglove_msgs, which is missing")
        self._stage, self._camera, self._depth, self._on_image = stage, camera, depth, on_image
        self._transport = transport
        self._is_lossy = False
        self._topics: set[str] = set()
        self._subscription = self._subscribed()
        self._latest_s = -_QUIET_S
        self._started_s = time.monotonic()
        stage.every(_POLL_S, self._poll)

    @property
    def quiet_s(self) -> float:
        """Time since the last image [s]."""
        return time.monotonic() - self._latest_s

    def explain(self) -> str:
        """Why no image arrives, as far as is known."""
        if self._offers(self._transport):
            return f"no image on {self._topic}, though it is published"
        return f"no image: no node publishes {self._topic}"

    @property
    def _topic(self) -> str:
        return f"{self._camera}/{TRANSPORTS[self._transport][0]}"

    def _subscribed(self) -> Any:
        kind = TRANSPORTS[self._transport][1]
        quality = (best_effort if self._is_lossy else reliable)(self._depth)
        # A user's override is for the first subscription: rclpy would apply it to the second too.
        first = self._topic not in self._topics
        self._topics.add(self._topic)
        return self._stage.subscription(kind, self._topic, self._receive, quality, overridable=first, adapts=True)

    def _receive(self, message: Message) -> None:
        self._latest_s = time.monotonic()
        self._on_image(message, self._transport)

    def _poll(self) -> None:
        """Adapt to what is published while no image arrives."""
        if self.quiet_s < _QUIET_S:
            return
        if offers := self._offers(self._transport):
            lossy = any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers)
            if lossy != self._is_lossy:
                if lossy:
                    self._stage.log.warning(f"{self._topic} is published with best effort: images may get lost")
                self._take(self._transport, lossy)
        elif time.monotonic() - self._started_s > _PATIENCE_S:
            for other, (ending, kind) in TRANSPORTS.items():
                # A bag of videos plays as raw images.
                if is_installed(kind) and self._offers(other):
                    self._stage.log.info(f"no node publishes {self._topic}; reads {self._camera}/{ending}")
                    self._take(other, is_lossy=False)
                    return

    def _take(self, transport: str, is_lossy: bool) -> None:
        self._stage.node.drop(self._subscription)
        self._transport, self._is_lossy = transport, is_lossy
        self._subscription = self._subscribed()

    def _offers(self, transport: str) -> list[QoSProfile]:
        return offered(self._stage, f"{self._camera}/{TRANSPORTS[transport][0]}")


class CameraModels:
    """Models of some cameras by their camera_info; the latest counts.

    The subscription is reliable; a second one follows what a driver offers, best effort or latched.

    Args:
        stage: uses the models.
        cameras: their names.
        on_change: called when a camera's model is known, changes, or is refused.
        fatal: whether an unusable camera_info ends the node; otherwise the camera is not used.

    Attributes:
        models: camera -> its model.
        refused: cameras whose camera_info is unusable.
        changes: how often a model became another.
    """

    def __init__(
        self, stage: Stage[Any], cameras: Iterable[str], on_change: Callable[[str], None], fatal: bool = False
    ) -> None:
        self._stage, self._log, self._on_change, self._fatal = stage, stage.log, on_change, fatal
        self._cameras = tuple(cameras)
        self._contents: dict[str, tuple[Any, ...]] = {}
        self.models: dict[str, CameraModel] = {}
        self.refused: set[str] = set()
        self.changes = 0
        self._adapted: set[tuple[str, str]] = set()
        for camera in self._cameras:
            self._subscribe(camera, reliable(_INFO_DEPTH))
        stage.every(_POLL_S, self._poll, even_inactive=True)

    @property
    def missing(self) -> list[str]:
        """Cameras without camera_info so far."""
        return [camera for camera in self._cameras if camera not in self._contents]

    def _subscribe(self, camera: str, quality: QoSProfile) -> None:
        # While a node is inactive, too: a driver may publish it only once.
        update = partial(self._update, camera)
        self._stage.subscription(_INFO, f"{camera}/camera_info", update, quality, even_inactive=True, adapts=True)

    def _poll(self) -> None:
        for camera in self.missing:
            for offer in offered(self._stage, f"{camera}/camera_info"):
                is_lossy = offer.reliability == ReliabilityPolicy.BEST_EFFORT
                is_latched = offer.durability == DurabilityPolicy.TRANSIENT_LOCAL and not is_lossy
                way = "lossy" if is_lossy else "latched" if is_latched else ""
                if way and (camera, way) not in self._adapted:
                    self._adapted.add((camera, way))
                    self._subscribe(camera, (best_effort if is_lossy else latched)(_INFO_DEPTH))

    def _update(self, camera: str, message: Message) -> None:
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
            self.refused.add(camera)
            self._log.error(f"{error}; the other cameras go on without this one")
        else:
            self.refused.discard(camera)
            if before is not None:
                self.changes += 1
                self._log.warning(f"camera {camera}: its camera_info has changed; restart")
        self._on_change(camera)


def offered(stage: Stage[Any], topic: str) -> list[QoSProfile]:
    """Quality of service of all publishers of a topic."""
    node = stage.node
    return [info.qos_profile for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))]


_STAMPS_OF_RATE = 31


class CameraTimings:
    """Publishers of ``<camera>/timing``, in the camera's own stamps.

    Args:
        stage: publishes.
        cameras: names.
    """

    def __init__(self, stage: Stage[Any], cameras: Iterable[str]) -> None:
        self._make = stage.make
        self._body: BodyModel | None = None
        self._stamps_ns: defaultdict[str, list[int]] = defaultdict(list)
        self._histories: dict[str, ClockHistory] = {}
        # Read-out time of the body file, and clock: late subscribers need both.
        self._publishers = {each: stage.publisher(TIMING_TYPE, f"{each}{TIMING}", latched(2)) for each in cameras}

    def set_body(self, body: BodyModel) -> None:
        """Set or replace the body."""
        self._body = body
        self._stamps_ns.clear()

    def add(self, matches: LandmarkMatches, model: CameraModel | None) -> None:
        """A registration; once the camera's rate is known, the body's read-out time of that video mode is published."""
        camera, stamps_ns = matches.camera, self._stamps_ns[matches.camera]
        if self._body is None or model is None or len(stamps_ns) >= _STAMPS_OF_RATE or camera not in self._body.mounts:
            return
        stamps_ns.append(matches.stamp_ns)
        if len(stamps_ns) == _STAMPS_OF_RATE:
            rate = 1e9 / float(np.median(np.diff(stamps_ns)))
            readout = self._body.mounts[camera].readout_in(VideoMode(model.width, model.height, model.fx, rate))
            if readout is not None:
                self._publishers[camera].publish(timing_message(self._make, camera, CameraTiming(0, "body", readout)))

    def publish_clocks(self, histories: Mapping[str, ClockHistory]) -> None:
        """Publish the clocks that have changed; each is valid from the stamp of its estimate."""
        for camera, history in histories.items():
            if history == self._histories.get(camera) or camera not in self._publishers:
                continue
            self._histories[camera] = history
            now = replace(history.latest, since_ns=max(history.latest.since_ns, history.latest.at_ns))
            # Without the read-out time, which the registration would count twice.
            for _, message in timing_messages(self._make, ClockHistory(camera, (now,))):
                self._publishers[camera].publish(message)
