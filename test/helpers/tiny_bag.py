"""A bag of two cameras and a few plain grey images, for tests of reading and writing."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from bodycam_ros.messages.factory import header_message
from bodycam_ros.recording.bag_writer import RecordingWriter, write_recording
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore

WIDTH, HEIGHT = 64, 48
FRAME_NS = 33_333_333
START_NS = 1_000_000_000
CAMERAS = ("left", "right")


def write_tiny_bag(
    path: Path,
    frames: int = 4,
    infos: tuple[str, ...] = CAMERAS,
    alter: Callable[[RecordingWriter], None] | None = None,
) -> Path:
    """Write the bag; frame k is a plain grey of 10 * (k + 1).

    Args:
        infos: cameras that get a camera_info with every image.
        alter: may append more messages.
    """
    with write_recording(path, command="a recorder") as writer:
        for frame in range(frames):
            stamp_ns = START_NS + frame * FRAME_NS
            for camera in CAMERAS:
                if camera in infos:
                    write_camera_info(writer, camera, stamp_ns)
                write_jpeg(writer, camera, stamp_ns, stamp_ns, 10 * (frame + 1))
        if alter:
            alter(writer)
    return path


def write_by_rosbags(path: Path) -> None:
    """Write a bag again as other recorders do by default: chunks are not compressed, and have no checksum."""
    with Reader(path) as bag:
        messages = [(connection, stamp_ns, bytes(cdr)) for connection, stamp_ns, cdr in bag.messages()]
    shutil.rmtree(path)
    with Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        written: dict[str, Connection] = {}
        for source, stamp_ns, cdr in messages:
            if source.topic not in written:
                connection = writer.add_connection(source.topic, source.msgtype, typestore=recording_typestore())
                written[source.topic] = connection
            writer.write(written[source.topic], stamp_ns, cdr)


def write_camera_info(writer: RecordingWriter, camera: str, stamp_ns: int, **changes: object) -> None:
    """Append the intrinsics of an equidistant camera, with some fields changed."""
    fields: dict[str, object] = {
        "width": WIDTH,
        "height": HEIGHT,
        "distortion_model": "equidistant",
        "d": np.zeros(4),
        "k": np.array([30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]),
    }
    make = recorded_messages()
    header = header_message(make, stamp_ns, f"{camera}_optical_frame")
    info = make("sensor_msgs/msg/CameraInfo", header=header, **(fields | changes))
    writer.write(f"/{camera}/camera_info", stamp_ns, info)


def write_jpeg(writer: RecordingWriter, camera: str, record_ns: int, stamp_ns: int, brightness: int) -> None:
    """Append a plain grey image that was recorded at one time and bears another."""
    make = recorded_messages()
    encoded = cv2.imencode(".jpg", np.full((HEIGHT, WIDTH), brightness, np.uint8))[1].reshape(-1)
    header = header_message(make, stamp_ns, f"{camera}_optical_frame")
    image = make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=encoded)
    writer.write(f"/{camera}/image_raw/compressed", record_ns, image)
