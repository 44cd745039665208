"""What a camera's driver publishes, images and camera_info, read in whatever way the driver offers it."""

import math
import time
from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError, SettingsError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.header import optical_frame
from bodycam_ros.messages.images import camera_model
from bodycam_ros.nodes.message_classes import is_installed
from bodycam_ros.nodes.qos import camera_info, latched, sensor_data
from bodycam_ros.nodes.qos_overrides import IMAGES_HEARD, INFOS_HEARD, overridden
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.nodes.topic_events import TopicEvents
from bodycam_ros.recording.typestore import COMPRESSED_VIDEO

KEPT_INFOS = "camera_infos"
"""Latched copies of the camera_info of all cameras, told apart by ``frame_id``: a node that starts again must not wait
for a driver that spoke once, or speaks every ten seconds."""

_INFO = "sensor_msgs/msg/CameraInfo"
TRANSPORTS = {
    "compressed": ("image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
    "raw": ("image_raw", "sensor_msgs/msg/Image"),
    "video": ("image_raw/compressed_video", COMPRESSED_VIDEO),
    "foxglove": ("image_raw/foxglove", COMPRESSED_VIDEO),
}
"""How images may be published: topic of a camera, and type."""

_INFO_DEPTH, _KEPT_DEPTH = 10, 200
_INFO_ADAPTS = (QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)
_LOOK_S = 0.5
_PATIENCE_S = 2.0
"""Who publishes the transport that is asked for may take a while to be discovered."""

_QUIET_S = 1.5
"""Who is heard no more, or not yet, may be published in another way."""


class ImageSource:
    """Reads a camera's images reliably, or with best effort from a driver that offers no more.

    While no image comes it looks at who publishes, and says what is in the way.

    Args:
        node: reads the images.
        camera: its name.
        transport: of ``TRANSPORTS``; another one is taken where it alone is published.
        depth: images that may wait in the subscription.
        on_image: called with each message, and its transport.

    Raises:
        SettingsError: there is no such transport here.
    """

    def __init__(
        self, node: StageNode[Any], camera: str, transport: str, depth: int, on_image: Callable[[Message, str], None]
    ) -> None:
        if transport not in TRANSPORTS:
            known = ", ".join(TRANSPORTS)
            raise SettingsError(f"the parameter 'transport' must be one of {known}, not '{transport}'")
        if not is_installed(TRANSPORTS[transport][1]):
            raise SettingsError(
                f"the transport '{transport}' needs the ROS package foxglove_msgs, which is not installed"
            )
        self._node = node
        self._camera = camera
        self._depth = depth
        self._on_image = on_image
        self._transport = transport
        self._reliability = ReliabilityPolicy.RELIABLE
        self._subscription = self._subscribe()
        self._heard_s = -_QUIET_S
        self._looked_since_s = time.monotonic()
        node.every(_LOOK_S, self._look)

    @property
    def quiet_s(self) -> float:
        """How long no image has come."""
        return time.monotonic() - self._heard_s

    def what_is_wrong(self) -> str:
        """Why no image comes, as far as can be seen."""
        if _offers(self._node, self._topic):
            return f"no image on {self._topic}, though it is published"
        return f"no image: nobody publishes {self._topic}"

    @property
    def _topic(self) -> str:
        return f"{self._camera}/{TRANSPORTS[self._transport][0]}"

    def _subscribe(self) -> Subscription:
        may = IMAGES_HEARD.resolved(self._reliability, DurabilityPolicy.VOLATILE)
        name = self._node.resolve_topic_name(self._topic)
        events = TopicEvents(name, self._node.skipped, () if self._is_fixed else (QoSPolicyKind.RELIABILITY,))
        kind = TRANSPORTS[self._transport][1]
        return self._node.subscription(kind, self._topic, self._receive, sensor_data(self._depth), may, events)

    @property
    def _is_fixed(self) -> bool:
        """Whether the user says how reliably images are read."""
        topic = self._node.resolve_topic_name(self._topic)
        return bool(overridden(self._node.overrides, topic, "subscription", "reliability"))

    def _receive(self, message: Message) -> None:
        self._heard_s = time.monotonic()
        self._on_image(message, self._transport)

    def _look(self) -> None:
        if self.quiet_s < _QUIET_S:
            return
        offers = _offers(self._node, self._topic)
        if offers:
            lossy = any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers)
            best = ReliabilityPolicy.BEST_EFFORT if lossy else ReliabilityPolicy.RELIABLE
            if best != self._reliability and not self._is_fixed:
                self._change(best)
        elif time.monotonic() - self._looked_since_s > _PATIENCE_S:
            self._take_other_transport()

    def _change(self, reliability: ReliabilityPolicy) -> None:
        self._reliability = reliability
        if reliability == ReliabilityPolicy.BEST_EFFORT:
            self._node.get_logger().warning(
                f"{self._topic} is published with best effort: images may get lost; reliable is better"
            )
        self._node.destroy_subscription(self._subscription)
        self._subscription = self._subscribe()

    def _take_other_transport(self) -> None:
        """Read what is published where the transport asked for is not: a bag of videos plays as raw images."""
        for other, (ending, kind) in TRANSPORTS.items():
            if other == self._transport or not _offers(self._node, f"{self._camera}/{ending}"):
                continue
            if not is_installed(kind):
                self._node.get_logger().warning(
                    f"{self._camera}/{ending} is published, but not to be read without the ROS package foxglove_msgs"
                )
                self._looked_since_s = math.inf
                continue
            self._node.get_logger().info(f"nobody publishes {self._topic}; reads {self._camera}/{ending}")
            self._transport = other
            self._change(ReliabilityPolicy.RELIABLE)
            return


class CameraModels:
    """Listens to the camera_info of some cameras, from the drivers or from the nodes that keep it; the latest counts.

    Args:
        node: listens.
        cameras: their names.
        on_change: called when a camera's model is known, changes, or is refused.
        keeps: whether to keep what is known for nodes that start later.
        fatal: whether an unusable camera_info ends the node; otherwise the other cameras go on without this one.

    Attributes:
        models: camera -> its model.
        refused: cameras whose camera_info is unusable.
        changes: how often a model became another.
    """

    def __init__(
        self,
        node: StageNode[Any],
        cameras: Iterable[str],
        on_change: Callable[[str], None],
        keeps: bool = True,
        fatal: bool = False,
    ) -> None:
        self._node = node
        self._on_change = on_change
        self._fatal = fatal
        self._sources = {camera: _InfoSource(node, camera, self._learn) for camera in cameras}
        self._kept = node.publisher(_INFO, KEPT_INFOS, latched(_KEPT_DEPTH)) if keeps else None
        self._names = {node.make.frame(optical_frame(camera)): camera for camera in self._sources}
        self._contents: dict[str, tuple[Any, ...]] = {}
        self.models: dict[str, CameraModel] = {}
        self.refused: set[str] = set()
        self.changes = 0
        # While a node is inactive, too: a driver may say it only once.
        node.subscription(_INFO, KEPT_INFOS, self._on_kept, latched(_KEPT_DEPTH), even_inactive=True)
        node.every(_LOOK_S, self._look, even_inactive=True)

    @property
    def missing(self) -> list[str]:
        """Cameras that were not heard of yet."""
        return [camera for camera in self._sources if camera not in self._contents]

    def _look(self) -> None:
        for source in self._sources.values():
            source.look()

    def _on_kept(self, message: Message) -> None:
        camera = self._names.get(message.header.frame_id)
        # Drivers know better; but what another node kept is there at once.
        if camera is not None and camera not in self._contents:
            self._learn(camera, message)

    def _learn(self, camera: str, message: Message) -> None:
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
            self._node.get_logger().error(f"{error}; the other cameras go on without this one")
        else:
            self.refused.discard(camera)
            if before is not None:
                self.changes += 1
                self._node.get_logger().warning(f"camera {camera}: its camera_info has changed; it begins anew with it")
            self._keep(camera, message)
        self._on_change(camera)

    def _keep(self, camera: str, message: Message) -> None:
        if self._kept is not None:
            # Nodes of this process may have heard the same message.
            kept = deepcopy(message)
            kept.header.frame_id = self._node.make.frame(optical_frame(camera))
            self._kept.publish(kept)


class _InfoSource:
    """The subscriptions to one camera's camera_info: reliable, and further ones where that does not hear a driver."""

    def __init__(self, node: StageNode[Any], camera: str, on_info: Callable[[str, Message], None]) -> None:
        self._node = node
        self._camera = camera
        self._on_info = on_info
        self._topic = f"{camera}/camera_info"
        self._heard_s = -_QUIET_S
        self._ways: set[tuple[ReliabilityPolicy, DurabilityPolicy]] = set()
        self._name = node.resolve_topic_name(self._topic)
        self._listen(ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)

    def look(self) -> None:
        """Adapt to who publishes, unless somebody is heard."""
        if time.monotonic() - self._heard_s < _QUIET_S:
            return
        for offer in _offers(self._node, self._topic):
            if offer.reliability == ReliabilityPolicy.BEST_EFFORT:
                self._listen(ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
            elif offer.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                self._listen(ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)

    def _listen(self, reliability: ReliabilityPolicy, durability: DurabilityPolicy) -> None:
        """Listen in a way, or in the one that the user wants, unless it does."""
        asked = {
            policy: word
            for policy in ("reliability", "durability")
            if (word := overridden(self._node.overrides, self._name, "subscription", policy))
        }
        way = (
            ReliabilityPolicy[asked.get("reliability", reliability.name).upper()],
            DurabilityPolicy[asked.get("durability", durability.name).upper()],
        )
        if way in self._ways:
            return
        self._ways.add(way)
        adapts = [policy for policy in _INFO_ADAPTS if policy.name.lower() not in asked]
        events = TopicEvents(self._name, self._node.skipped, adapts)
        may = INFOS_HEARD.resolved(reliability, durability)
        quality = camera_info(_INFO_DEPTH)
        self._node.subscription(_INFO, self._topic, self._receive, quality, may, events, even_inactive=True)

    def _receive(self, message: Message) -> None:
        self._heard_s = time.monotonic()
        self._on_info(self._camera, message)


def _offers(node: StageNode[Any], topic: str) -> list[QoSProfile]:
    """How a topic is published."""
    return [info.qos_profile for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))]
