"""Blur and darken a recording: python -m benchmarks.disturb_recording RECORDING OUT --blur 0.8 --darkest 0.4.

Each image is averaged along its optical flow over a share of the time between two images, as a longer exposure would;
the share swings between 0 and ``--blur`` and the gain between ``--darkest`` and 1, every camera at its own phase.
White balance drifts by a tenth. The cut holds bag and ``rig.yaml``; the truth stays where it is.
"""

import argparse
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer

from bodycam_ros.recording.typestore import recording_typestore

_PERIOD_S = 2.5
_EXPOSURES = 9
_JPEG_QUALITY = 95
_READ_NOISE = 1.0

Triple = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]
"""An image (H, W, C), the one before and the one after."""


def blurred(
    image: NDArray[np.uint8], before: NDArray[np.uint8], after: NDArray[np.uint8], share: float
) -> NDArray[np.uint8]:
    """The image (H, W, C) as an exposure over a share of the interval would show it, by its neighbours' flow."""
    if share == 0.0:
        return image
    flow_of = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    grey = [cv2.cvtColor(i, cv2.COLOR_BGR2GRAY) for i in (before, image, after)]
    flow = 0.5 * (flow_of.calc(grey[1], grey[2], None) - flow_of.calc(grey[1], grey[0], None))
    height, width = image.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    total = np.zeros(image.shape, np.float32)
    for time in np.linspace(-0.5, 0.5, _EXPOSURES) * share:
        shift = np.float32(time) * flow
        total += cv2.remap(image, columns - shift[..., 0], rows - shift[..., 1], cv2.INTER_LINEAR)
    return np.asarray(total / _EXPOSURES, np.uint8)


def disturb_bag(source: Path, target: Path, blur: float, darkest: float) -> None:
    """Write the disturbed bag; everything but images as it is."""
    noise: dict[int, np.random.Generator] = {}

    def disturbed(number: int, since_ns: int, triple: Triple) -> NDArray[np.uint8]:
        rng = noise.setdefault(number, np.random.default_rng(number))
        turn = 2 * np.pi * 1e-9 * since_ns / _PERIOD_S + 2.4 * number
        share, gain = 0.5 * blur * (1 - np.cos(turn)), darkest + (1 - darkest) * 0.5 * (1 + np.cos(0.7 * turn))
        balance = gain * (1 + 0.1 * np.sin(1.3 * turn + np.array([0.0, 2.0, 4.0])))
        light = balance * blurred(*triple, share) + rng.normal(0.0, _READ_NOISE, triple[0].shape)
        return np.asarray(np.clip(light, 0, 255), np.uint8)

    _rewrite(source, target, disturbed)


def blur_bag(source: Path, target: Path, share: float, start_s: float, end_s: float) -> None:
    """Write a bag whose images from start to end [s] are exposed for a share of their interval."""

    def exposed(number: int, since_ns: int, triple: Triple) -> NDArray[np.uint8] | None:
        return blurred(*triple, share) if start_s <= 1e-9 * since_ns < end_s else None

    _rewrite(source, target, exposed)


def _rewrite(source: Path, target: Path, change: Callable[[int, int, Triple], NDArray[np.uint8] | None]) -> None:
    """Write a bag with other images, by the camera's number, the time since the start [ns] and the image.

    Where ``change`` gives None, and of all other topics, messages are as they were.
    """
    typestore = recording_typestore()
    with (
        AnyReader([source], default_typestore=typestore) as reader,
        Writer(target, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        written = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=typestore) for c in reader.connections}
        images = [c for c in reader.connections if c.topic.endswith("/compressed")]
        others = [c for c in reader.connections if c not in images]
        for connection, stamp, data in reader.messages(others):
            writer.write(written[connection.id], stamp, data)
        for number, connection in enumerate(images):
            for stamp, message, triple in _triples(reader, connection):
                changed = change(number, stamp - reader.start_time, triple)
                if changed is not None:
                    quality = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
                    message.data = cv2.imencode(".jpg", changed, quality)[1].ravel()
                writer.write(written[connection.id], stamp, typestore.serialize_cdr(message, connection.msgtype))


def _triples(reader: AnyReader, connection: Connection) -> Iterator[tuple[int, Any, Triple]]:
    """Stamp, message and image of a camera."""
    read = reader.messages([connection])
    messages: list[tuple[int, Any]] = [(stamp, reader.deserialize(data, c.msgtype)) for c, stamp, data in read]
    pixels = [cv2.imdecode(np.asarray(m.data), cv2.IMREAD_COLOR) for _, m in messages]
    last = len(messages) - 1
    for index, (stamp, message) in enumerate(messages):
        yield stamp, message, (pixels[index], pixels[max(index - 1, 0)], pixels[min(index + 1, last)])


def main() -> None:
    """Parse the command line and disturb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--blur", type=float, default=0.8, help="longest exposure, as a share of the time of an image")
    parser.add_argument("--darkest", type=float, default=0.4, help="least gain")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True)
    disturb_bag(arguments.recording / "bag", arguments.out / "bag", arguments.blur, arguments.darkest)
    shutil.copy(arguments.recording / "rig.yaml", arguments.out / "rig.yaml")


if __name__ == "__main__":
    main()
