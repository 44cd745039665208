"""What an image costs by its size: python -m benchmarks.picture_cost BAG --map MAP.

The images of one camera of a recording are enlarged and compressed as H.264. Their decoding, and what the camera's
front takes for each, are timed in one thread; minutes of a recording for each hour of a core follow by division.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, VideoPacket, decode_grey
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.pipeline.camera_front import camera_fronts
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_decoder import VideoDecoder
from bodycam_ros.recording.video_encoder import h264_packets
from bodycam_ros.registration.reference_map import ReferenceMap, load_map

_SIZES = ((640, 480), (1440, 1080), (2880, 2160))
_WARM = 10  # images before those that are timed
_CAMERAS, _RATE_HZ = 16, 30.0


@dataclass(frozen=True)
class PictureCost:
    """Milliseconds of one core for an image: to decode it, and to track and register it; share that was registered."""

    decode_ms: float
    front_ms: float
    registered: float


def picture_cost(images: Sequence[CameraImage], camera: CameraModel, reference_map: ReferenceMap) -> PictureCost:
    """What some images of a camera cost."""
    settings = PipelineSettings(extension=ExtensionSettings(enabled=False))
    front = camera_fronts({camera.name: camera}, reference_map, settings, readouts={}, turns={})[camera.name]
    decoder, decode_s, front_s, registered = VideoDecoder(), list[float](), list[float](), list[bool]()
    for image in images:
        started_s = time.thread_time()
        greys = [(decode_grey(ready), ready.stamp_ns) for ready in decoder.feed(image)]
        decode_s.append(time.thread_time() - started_s)
        for grey, stamp_ns in greys:
            started_s = time.thread_time()
            _, matches, _ = front.process(grey, stamp_ns)
            front_s.append(time.thread_time() - started_s)
            registered.append(matches.world_T_camera is not None)
    decode_ms, front_ms = (1e3 * float(np.mean(each[_WARM:])) for each in (decode_s, front_s))
    return PictureCost(decode_ms, front_ms, float(np.mean(registered)))


def as_h264(pictures: Sequence[NDArray[np.uint8]], size: tuple[int, int], camera: str) -> list[CameraImage]:
    """Images of a size [px], compressed as a person's cameras do."""
    large = (cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC) for picture in pictures)
    frames = ((number / _RATE_HZ, av.VideoFrame.from_ndarray(each, "gray")) for number, each in enumerate(large))
    packets = h264_packets(frames, 0, _RATE_HZ, 1)
    return [CameraImage(camera, 10**9 + round(1e9 * seconds), packet) for seconds, packet in packets]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--camera", default="torso_front")
    parser.add_argument("--images", type=int, default=60)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    reference_map = load_map(arguments.map)
    with open_recording(arguments.recording) as recording:
        camera = recording.camera_model(arguments.camera)
        images = list(islice(recording.images([camera.name]), arguments.images))
    _print_cost("JPEG", camera, picture_cost(images, camera, reference_map))
    pictures = [decode_grey(image) for image in images]
    for size in _SIZES:
        scale = size[0] / camera.width
        scaled = replace(
            camera,
            width=size[0],
            height=size[1],
            fx=scale * camera.fx,
            fy=scale * camera.fy,
            cx=scale * (camera.cx + 0.5) - 0.5,
            cy=scale * (camera.cy + 0.5) - 0.5,
        )
        packets = as_h264(pictures, size, camera.name)
        assert all(isinstance(packet.content, VideoPacket) for packet in packets)
        _print_cost("H.264", scaled, picture_cost(packets, scaled, reference_map))


def _print_cost(coding: str, camera: CameraModel, cost: PictureCost) -> None:
    minutes = 60.0 / (1e-3 * (cost.decode_ms + cost.front_ms) * _CAMERAS * _RATE_HZ)
    print(
        f"{coding} {camera.width}x{camera.height}: {cost.decode_ms:.1f} ms decoded, {cost.front_ms:.1f} ms tracked and "
        f"registered ({cost.registered:.0%}); {minutes:.1f} min of {_CAMERAS} cameras for an hour of a core",
        flush=True,
    )


if __name__ == "__main__":
    main()
