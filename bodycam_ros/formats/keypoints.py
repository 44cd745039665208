"""2-D keypoints of static cameras, as OpenPose's JSON: a folder a camera, a file a frame.

Pose2Sim, RTMPose and MediaPipe pipelines write them too: ``{"people": [{"pose_keypoints_2d": [x, y, score, ...]}]}``.
The layout follows from the count: COCO-17, COCO-18, BODY_25, HALPE_26, COCO-133 (whole body).
"""

import json
import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import few, shown
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.geometry import Array

logger = logging.getLogger(__name__)

JOINTS = tuple(
    f"{side}{joint}" for joint in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle") for side in ("L", "R")
)
"""Keypoints that are joints of a body; those of face, fingers and toes are not used."""

_COCO = range(5, 17)
_BODY_25 = (5, 2, 6, 3, 7, 4, 12, 9, 13, 10, 14, 11)
_COCO_18 = (5, 2, 6, 3, 7, 4, 11, 8, 12, 9, 13, 10)
_ROWS: Mapping[int, Sequence[int]] = {17: _COCO, 18: _COCO_18, 25: _BODY_25, 26: _COCO, 133: _COCO}
"""Keypoints of a person -> rows of ``JOINTS``."""

_LAST_NUMBER = re.compile(r"\d+(?=\D*$)")
_MOST_BYTES = 20_000_000
_MOST_PEOPLE = 20

Frame = Sequence[Array]
"""People in an image of a camera: (12, 3) of each, pixel and score of ``JOINTS``."""


def is_keypoints(path: Path) -> bool:
    """Whether a path is a folder of keypoints: it has folders with JSON files in them."""
    return path.is_dir() and any(path.glob("*/*.json"))


def read_keypoints(path: Path, cameras: Iterable[str], most_frames: int) -> dict[str, list[Frame]]:
    """Camera -> people in each of the first frames; cameras without a folder are left out.

    A camera's folder begins with its name (``cam01``, ``cam01_json``); where none does and there are as many folders as
    cameras, both are taken in the order of their names.

    Raises:
        BodyError: fewer than two cameras have keypoints, or a file is damaged.
    """
    cameras = list(cameras)
    folders = sorted(folder for folder in path.iterdir() if folder.is_dir() and any(folder.glob("*.json")))
    named = {name: found for name in cameras if (found := _folder_of(name, folders, cameras)) is not None}
    if not named and len(folders) == len(cameras):
        named = dict(zip(sorted(cameras), folders, strict=True))
        pairs = ", ".join(f"{folder.name} -> {name}" for name, folder in named.items())
        logger.warning("%s: no folder has the name of a camera; folders are assigned in order: %s", path, pairs)
    if len(named) < 2:
        raise BodyError(
            f"{path}: expected a folder of JSON files for two cameras or more, named as they are "
            f"({few(cameras, most=10)}), and found {few([folder.name for folder in folders], most=10) or 'none'}"
        )
    read: dict[str, list[Frame]] = {}
    for name, folder in named.items():
        files = sorted(folder.glob("*.json"), key=lambda file: (_number(file), file.name))[:most_frames]
        read[name] = [_people(file) for file in files]
    return read


def _folder_of(name: str, folders: Sequence[Path], cameras: Sequence[str]) -> Path | None:
    """The folder of a camera: its name, or what begins with it, and with no longer camera's name."""
    for folder in folders:
        begins = [camera for camera in cameras if folder.name.lower().startswith(camera.lower())]
        if begins and max(begins, key=len) == name:
            return folder
    return None


def _number(file: Path) -> int:
    found = _LAST_NUMBER.search(file.stem)
    return int(found[0][-18:]) if found else 0


def _people(file: Path) -> Frame:
    text = read_text(file, "file of keypoints", BodyError, _MOST_BYTES)
    try:
        people = json.loads(text)["people"]
        return [_person(person["pose_keypoints_2d"]) for person in people[:_MOST_PEOPLE]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise BodyError(
            f"{file}: expected JSON of OpenPose, with people and their pose_keypoints_2d: {shown(str(error))}"
        ) from error


def _person(values: Any) -> Array:
    numbers = np.array(values, np.float64).reshape(-1, 3)
    rows = _ROWS.get(len(numbers))
    if rows is None:
        raise ValueError(f"{len(numbers)} keypoints a person; known are {', '.join(map(str, _ROWS))}")
    found = numbers[list(rows)]
    found[~np.isfinite(found).all(axis=1), 2] = 0.0
    return found
