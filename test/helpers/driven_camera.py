"""A camera driver that a test drives: raw images that show much to be tracked, and camera_info on request."""

import time
from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np

from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.factory import array_sequence, header_message
from helpers.tiny_bag import FRAME_NS, HEIGHT, START_NS, WIDTH

PERIOD_S = 0.05


def stamps(first: int, count: int) -> list[int]:
    """Stamps of a number of images in a row [ns]."""
    return [START_NS + (first + k) * FRAME_NS for k in range(count)]


class DrivenCamera:
    """A driver of raw images that show much to be tracked."""

    def __init__(self, graph: Any, name: str, quality: Any, info_quality: Any) -> None:
        from bodycam_ros.nodes.parameters import node_messages

        self.name = name
        self._make = node_messages()
        self.images = graph.publisher(f"/{name}/image_raw", "sensor_msgs/msg/Image", quality)
        self._infos = graph.publisher(f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo", info_quality)
        self.tracker = GraphNode("tracker", f"tracker_{name}", {"camera": name, "transport": "raw"})
        self._due_s = 0.0
        blobs = np.random.default_rng(3).integers(0, 255, (HEIGHT // 4, WIDTH // 4), dtype=np.uint8)
        self._pixels = cv2.resize(blobs, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC).reshape(-1)

    def show(self, stamps: Iterable[int]) -> None:
        for stamp in stamps:
            header = header_message(self._make, stamp, "")
            image = self._make("sensor_msgs/msg/Image", header=header, width=WIDTH, height=HEIGHT, encoding="mono8")
            image.step, image.data = WIDTH, array_sequence(self._pixels)
            self.images.publish(image)

    def is_due(self) -> bool:
        """Whether it is time for another image."""
        due = time.monotonic() > self._due_s
        if due:
            self._due_s = time.monotonic() + PERIOD_S
        return due

    def inform(self, focal_px: float = 30.0) -> None:
        info = self._make("sensor_msgs/msg/CameraInfo", width=WIDTH, height=HEIGHT, distortion_model="equidistant")
        info.d, info.k = [0.0] * 4, [focal_px, 0.0, 31.5, 0.0, focal_px, 23.5, 0.0, 0.0, 1.0]
        self._infos.publish(info)
