"""What a camera's driver publishes, images and camera_info, read in whatever way the driver offers it."""

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.qos import ReliabilityPolicy
from rclpy.subscription import Subscription

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import CalibrationError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import camera_model
from bodycam_ros.nodes.qos import best_effort, reliable
from bodycam_ros.nodes.stage_node import StageNode

_INFO_DEPTH = 10
_TOPICS = {
    "compressed": ("image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
    "raw": ("image_raw", "sensor_msgs/msg/Image"),
}
_LOOK_S = 1.0


class ImageSource:
    """Reads a camera's images reliably, or with best effort from a driver that offers no more.

    Until the first image it looks at who publishes, and says what is in the way.

    Args:
        node: reads the images.
        camera: its name.
        transport: "compressed" or "raw".
        depth: images that may wait in the subscription.
        on_image: called with each message.
    """

    def __init__(
        self, node: StageNode[Any], camera: str, transport: str, depth: int, on_image: Callable[[Message], None]
    ) -> None:
        self._node = node
        self._camera = camera
        self._depth = depth
        self._on_image = on_image
        self._transport = transport
        self._topic = f"{camera}/{_TOPICS[transport][0]}"
        self._subscription: Subscription = self._subscribe(reliable(depth))
        self._timer = node.create_timer(_LOOK_S, self._look)
        self._said = False

    def _subscribe(self, quality: Any) -> Subscription:
        return self._node.subscription(_TOPICS[self._transport][1], self._topic, self._receive, quality)

    def _receive(self, message: Message) -> None:
        if not self._timer.is_canceled():
            self._timer.cancel()
        self._on_image(message)

    def _look(self) -> None:
        offers = self._node.get_publishers_info_by_topic(self._resolved(self._topic))
        reliability = {offer.qos_profile.reliability for offer in offers}
        if reliability == {ReliabilityPolicy.BEST_EFFORT}:
            self._node.get_logger().warning(
                f"{self._topic} is published with best effort: images may get lost; reliable is better"
            )
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe(best_effort(self._depth))
            self._timer.cancel()
        elif not offers and not self._said:
            self._look_at_other_transport()

    def _look_at_other_transport(self) -> None:
        other = next(name for name in _TOPICS if name != self._transport)
        topic = f"{self._camera}/{_TOPICS[other][0]}"
        if self._node.get_publishers_info_by_topic(self._resolved(topic)):
            self._said = True
            self._node.get_logger().warning(
                f"nobody publishes {self._topic}, but {topic} is there; to read it start with -p transport:={other}"
            )

    def _resolved(self, topic: str) -> str:
        name: str = self._node.resolve_topic_name(topic)
        return name


class CameraModels:
    """Listens to the camera_info of some cameras; the first message of each counts.

    Args:
        node: listens.
        cameras: their names.
        on_change: called when a camera's model is known, or refused.

    Attributes:
        models: camera -> its model.
        refused: cameras whose camera_info is unusable; the others go on without them.
    """

    def __init__(self, node: StageNode[Any], cameras: Iterable[str], on_change: Callable[[str], None]) -> None:
        self._node = node
        self._on_change = on_change
        self.models: dict[str, CameraModel] = {}
        self.refused: set[str] = set()
        self._awaited = {camera: self._listen(camera) for camera in cameras}

    @property
    def missing(self) -> list[str]:
        """Cameras that were not heard of yet."""
        return [camera for camera in self._awaited if camera not in self.models and camera not in self.refused]

    def _listen(self, camera: str) -> Any:
        def on_info(message: Message) -> None:
            self._learn(camera, message)

        return self._node.subscription(
            "sensor_msgs/msg/CameraInfo", f"{camera}/camera_info", on_info, reliable(_INFO_DEPTH)
        )

    def _learn(self, camera: str, message: Message) -> None:
        if camera in self.models or camera in self.refused:
            return
        try:
            self.models[camera] = camera_model(message, camera)
        except CalibrationError as error:
            self.refused.add(camera)
            self._node.get_logger().error(f"{error}; the other cameras go on without this one")
        self._on_change(camera)
