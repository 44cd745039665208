"""Keypoints of a whole recording: a file for each image, matched by their numbers."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.keypoints import JOINTS, is_keypoints, read_keypoints
from bodycam_ros.static_cameras.keypoint_evidence import KeypointEvidence, RecordedPeople
from bodycam_ros.static_cameras.static_camera import StaticCamera

_WITHOUT_END = 1_000_000


def read_recorded_keypoints(
    folder: Path, stations: Mapping[str, StaticCamera], body: BodyModel, stamps_ns: Mapping[str, NDArray[np.int64]]
) -> KeypointEvidence:
    """Keypoints of the images of static cameras.

    Args:
        folder: with a folder for each camera, as ``read_keypoints``.
        stations: by name.
        body: whose joints they are.
        stamps_ns: camera -> (N,) stamps of all of its images in the recording [ns], in their order.

    Raises:
        BodyError: it is no such folder, a file is damaged, or a camera has not as many files as images.
    """
    if not is_keypoints(folder):
        raise BodyError(f"{folder}: expected a folder for each camera, with a JSON file of keypoints for each image")
    people = {}
    for camera, frames in read_keypoints(folder, stations, _WITHOUT_END).items():
        stamps = stamps_ns[camera]
        if len(frames) != len(stamps):
            raise BodyError(
                f"{folder}: camera {camera} has {len(frames)} files of keypoints and {len(stamps)} images in the "
                "recording; expected a file for each image. Detect keypoints in the images of this recording, with an "
                "empty list of people where there is nobody"
            )
        people[camera] = dict(zip(stamps.tolist(), frames, strict=True))
    return KeypointEvidence(body, stations, JOINTS, RecordedPeople(people))
