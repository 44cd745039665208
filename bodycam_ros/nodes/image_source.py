"""The subscription to a camera's images, which copes with what drivers offer."""

from collections.abc import Callable
from typing import Any

from rclpy.qos import ReliabilityPolicy
from rclpy.subscription import Subscription

from bodycam_ros.messages.factory import Message
from bodycam_ros.nodes.quality import best_effort, reliable
from bodycam_ros.nodes.stage_node import StageNode

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
