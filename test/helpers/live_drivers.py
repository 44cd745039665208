"""The sample's camera drivers, live, for as long as a test wants. Import it only where rclpy is."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bodycam_ros.graph.declared_graph import READERS_OF_INFO
from bodycam_ros.messages.factory import time_message
from bodycam_ros.nodes.parameters import node_messages
from bodycam_ros.recording.bag_file import BagFile

RATE = 16.0
"""Images a second: little, so that a machine that is busy with other tests holds it."""

FRAME_NS = 33_333_333
START_NS = 1_000_000_000_000


class Drivers:
    """The sample's cameras, there and back again: a motion without end, with camera_info beside every image."""

    def __init__(self, graph: Any, bag: Path, cameras: Sequence[str]) -> None:
        self._graph = graph
        self._make = node_messages()
        self._images: dict[str, list[bytes]] = {}
        self._infos: dict[str, Any] = {}
        topics = [f"/{camera}/{kind}" for camera in cameras for kind in ("camera_info", "image_raw/compressed")]
        with BagFile(bag) as recorded:
            for topic, _, message in recorded.messages(topics):
                camera = topic.split("/")[1]
                if topic.endswith("camera_info"):
                    self._infos[camera] = message
                else:
                    self._images.setdefault(camera, []).append(bytes(message.data))
        self._publishers = {
            camera: graph.publisher(f"/{camera}/image_raw/compressed", "sensor_msgs/msg/CompressedImage")
            for camera in cameras
        }
        self._info_publishers = {
            camera: graph.publisher(f"/{camera}/camera_info", "sensor_msgs/msg/CameraInfo") for camera in cameras
        }
        self._due_s = 0.0
        self._next = 0

    @property
    def stamp_ns(self) -> int:
        """The stamp of the latest images."""
        return START_NS + (self._next - 1) * FRAME_NS

    def are_heard(self) -> bool:
        images, infos = self._publishers.values(), self._info_publishers.values()
        return all(publisher.get_subscription_count() for publisher in images) and all(
            publisher.get_subscription_count() == READERS_OF_INFO for publisher in infos
        )

    def go_on(self) -> None:
        """Publish the next images if they are due; who was kept from that goes on from there, without a burst."""
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + 1.0 / RATE
        stamp = time_message(self._make, START_NS + self._next * FRAME_NS)
        for camera, images in self._images.items():
            turn = self._next % (2 * len(images) - 2)
            data = images[min(turn, 2 * len(images) - 2 - turn)]
            message = self._make("sensor_msgs/msg/CompressedImage", format="jpeg")
            message.header.stamp, message.data = stamp, data
            self._publishers[camera].publish(message)
            self._info_publishers[camera].publish(self._info(camera))
        self._next += 1

    def _info(self, camera: str) -> Any:
        of = self._infos[camera]
        message = self._make("sensor_msgs/msg/CameraInfo", width=of.width, height=of.height)
        message.distortion_model = of.distortion_model
        message.d = of.d.tolist()
        message.k = of.k.tolist()
        return message

    def until(self, condition: Any, timeout_s: float, what: str) -> None:
        """Go on until something is the case."""

        def holds() -> object:
            self.go_on()
            return condition()

        self._graph.until(holds, timeout_s, what)
