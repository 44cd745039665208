"""Recordings with cameras that are blind, silent, exchanged or have the wrong calibration, as bags on disk."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

LEFT_LEG = ("thigh_left", "shin_left", "foot_left")
LEFT_ARM = ("upper_arm_left", "forearm_left")
GREY, GONE = "grey", "gone"

Disturbance = Callable[[str, float, int], str | None]
"""Camera, seconds since the first image and number of the image -> GREY, GONE or None: as it is."""


def during(cameras: Collection[str] | None, start_s: float, end_s: float, what: str) -> Disturbance:
    """Images of some cameras (None: of all) from start to end [s]."""
    return lambda camera, s, number: what if (cameras is None or camera in cameras) and start_s <= s < end_s else None


def every_third(camera: str, seconds: float, number: int) -> str | None:
    """Keep every third image."""
    return GONE if number % 3 else None


def every_sixth(camera: str, seconds: float, number: int) -> str | None:
    """Keep every sixth image: five a second."""
    return GONE if number % 6 else None


def quarter_in_turn(cameras: Collection[str], each_s: float = 0.5) -> Disturbance:
    """Every fourth camera at a time is dark, for so long each [s]."""
    order = {camera: place % 4 for place, camera in enumerate(sorted(cameras))}
    return lambda camera, seconds, number: GREY if order[camera] == int(seconds / each_s) % 4 else None


def write_disturbed(
    source: Path,
    target: Path,
    disturbance: Disturbance = lambda camera, seconds, number: None,
    renamed: Mapping[str, str] | None = None,
    focal: Mapping[str, float] | None = None,
) -> Path:
    """Copy a bag with its images disturbed; return the copy.

    Args:
        source, target: ros2 bag folders.
        disturbance: what becomes of each image.
        renamed: camera -> the camera whose images it gets; both keep their camera_info.
        focal: camera -> factor on the focal lengths of its camera_info.
    """
    typestore = get_typestore(Stores.ROS2_JAZZY)
    renamed, focal = renamed or {}, focal or {}
    grey = np.ascontiguousarray(cv2.imencode(".jpg", np.full((480, 640), 127, np.uint8))[1].ravel())
    with (
        AnyReader([source], default_typestore=typestore) as reader,
        Writer(target, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        written = {c.topic: writer.add_connection(c.topic, c.msgtype, typestore=typestore) for c in reader.connections}
        numbers: dict[str, int] = {}
        for connection, stamp, data in reader.messages():
            camera, _, kind = connection.topic[1:].partition("/")
            topic = connection.topic
            if kind.startswith("image_raw"):
                number = numbers[camera] = numbers.get(camera, -1) + 1
                what = disturbance(camera, 1e-9 * (stamp - reader.start_time), number)
                if what == GONE:
                    continue
                if what == GREY:
                    image: Any = reader.deserialize(data, connection.msgtype)
                    image.data = grey
                    data = bytes(typestore.serialize_cdr(image, connection.msgtype))
                topic = f"/{renamed.get(camera, camera)}/{kind}"
            elif kind == "camera_info" and camera in focal:
                info: Any = reader.deserialize(data, connection.msgtype)
                info.k = info.k * _focal_factors(focal[camera], 9)
                info.p = info.p * _focal_factors(focal[camera], 12)
                data = bytes(typestore.serialize_cdr(info, connection.msgtype))
            writer.write(written[topic], stamp, data)
    return target


def _focal_factors(factor: float, length: int) -> np.ndarray:
    """Factors of the entries of K (9) or P (12), whose first and sixth or fifth are the focal lengths."""
    factors = np.ones(length)
    factors[[0, 4 if length == 9 else 5]] = factor
    return factors


def write_slipped(body: Path, target: Path, camera: str, by_m: float) -> Path:
    """Copy a body file in which a camera sits elsewhere on its segment: its strap slipped after the calibration."""
    document = yaml.safe_load(body.read_text())
    document["cameras"][camera]["position"][2] += by_m
    target.write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None))
    return target
