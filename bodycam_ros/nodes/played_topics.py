"""What the player publishes, and who reads it."""

import time
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from rclpy.duration import Duration

from bodycam_ros.nodes.qos import STAGE_DEPTH, latched, reliable
from bodycam_ros.nodes.qos_overrides import MOTION_SAID
from bodycam_ros.nodes.stage_node import StageNode

INFO, TIMING = "/camera_info", "/timing"
IMAGES = ("/image_raw/compressed", "/image_raw", "/image_raw/compressed_video", "/image_raw/foxglove")

_REPEAT_S = 1.0
"""A reader that comes late and does not ask for latched messages waits no longer for a camera_info."""


def camera_of(topic: str) -> str:
    """Name of the camera that a topic belongs to; empty if it belongs to none."""
    for ending in (INFO, TIMING, *IMAGES):
        if topic.endswith(ending):
            return topic.removesuffix(ending).removeprefix("/")
    return ""


def few(parts: Sequence[str]) -> str:
    """The first of them, and how many more there are."""
    more = f" and {len(parts) - 3} more" if len(parts) > 3 else ""
    return ", ".join(parts[:3]) + more


class PlayedTopics:
    """Publishers of cameras' images, camera_info and timing.

    camera_info and timing are latched, camera_info repeated for readers that come late and do not know that.

    Args:
        node: publishes.
        types: topic of the bag -> message type. Each is published in the node's namespace, as a camera's driver would.

    Attributes:
        types: as given.
    """

    def __init__(self, node: StageNode[Any], types: Mapping[str, str]) -> None:
        self._node = node
        self.types = types
        self._publishers = {
            topic: node.publisher(
                kind,
                topic.lstrip("/"),
                latched() if topic.endswith((INFO, TIMING)) else reliable(STAGE_DEPTH),
                MOTION_SAID,
            )
            for topic, kind in types.items()
        }
        self._infos: dict[str, tuple[bytes, float]] = {}

    def publish(self, topic: str, serialized: bytes) -> None:
        """Publish a message."""
        self._publishers[topic].publish(serialized)
        if topic.endswith(INFO):
            self._infos[topic] = (serialized, time.monotonic())

    def repeat_infos(self) -> None:
        """Publish those camera_info again that were not for a while."""
        now_s = time.monotonic()
        for topic, (serialized, said_s) in self._infos.items():
            if now_s - said_s > _REPEAT_S:
                self.publish(topic, serialized)

    def lacking(self, readers_of_info: int, image_only: Collection[str] = ()) -> list[str]:
        """What too few nodes read, with how many do: of each camera one reader of images is enough.

        Args:
            readers_of_info: nodes that are to read each camera_info.
            image_only: cameras whose camera_info nobody has to read.
        """
        lacking = []
        for camera in dict.fromkeys(map(camera_of, self.types)):
            of_images = [f"/{camera}{ending}" for ending in IMAGES if f"/{camera}{ending}" in self.types]
            # A bag may have them raw and compressed, and nobody needs both.
            if of_images and not any(self._readers(topic, 1) for topic in of_images):
                lacking.append(f"{of_images[0]} (nobody)")
            info = f"/{camera}{INFO}"
            if (
                camera not in image_only
                and info in self.types
                and (readers := self._readers(info, readers_of_info)) < readers_of_info
            ):
                lacking.append(f"{info} ({readers} of {readers_of_info} nodes)")
        return lacking

    def are_heard(self, patience: Duration) -> bool:
        """Whether the readers have everything, or get it within the patience for each topic."""
        return all(publisher.wait_for_all_acked(patience) for publisher in self._publishers.values())

    def _readers(self, topic: str, wanted: int) -> int:
        """Nodes that are connected, as far as they are wanted."""
        subscriptions: int = self._publishers[topic].get_subscription_count()
        if wanted <= 1 or subscriptions < wanted:
            return min(wanted, subscriptions)
        # One node may have several subscriptions. To ask whose they are takes longer.
        known = self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name(topic.lstrip("/")))
        return min(wanted, len({(reader.node_namespace, reader.node_name) for reader in known}))
