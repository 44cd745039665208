"""Static cameras of a recording: their poses from a file, or by registration."""

import logging
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera.model import size_mismatch
from bodycam_ros.errors import LensError, RecordingError, StaticCameraError
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.formats.static_cameras_file import read_static_cameras, refuse_body_cameras
from bodycam_ros.recording.bag_reader import Recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_camera_registration import (
    RegisteredStaticCamera,
    StaticCameraRegistration,
    StaticCamerasSettings,
)

logger = logging.getLogger(__name__)

_IMAGES = 12  # of each camera, spread over the recording: people have moved on from one to the next
_OTHER_LENS = 0.02  # share by which focal lengths differ


def read_recorded_static_cameras(
    given: StaticCameraFiles, reference_map: ReferenceMap | None, recording: Recording, body: BodyModel
) -> dict[str, StaticCamera]:
    """The static cameras that a recording has images of; a lens that contradicts its camera_info is warned about.

    Raises:
        StaticCameraError: the file cannot be used, the recording has none of its cameras, or one is on the body.
    """
    stations, cameras = read_static_cameras(given.stations, reference_map), recording.cameras
    stations = _renamed(given.stations, stations, cameras)
    there = {name: station for name, station in stations.items() if name in cameras}
    if not there:
        raise StaticCameraError(
            f"{given.stations}: the recording has none of its cameras ({', '.join(stations)}); it has "
            f"{', '.join(cameras)}. A camera is named as its topics: /NAME/image_raw/compressed"
        )
    if silent := sorted(set(stations) - set(there)):
        logger.warning("%s: the recording has no images of %s", given.stations, ", ".join(silent))
    refuse_body_cameras(given.stations, there, body)
    others = [_other_lens(given.stations, station, recording) for station in there.values()]
    for line in merge_lines(filter(None, others)):
        logger.warning("%s", line)
    return there


def _renamed(path: Path, stations: dict[str, StaticCamera], cameras: Sequence[str]) -> dict[str, StaticCamera]:
    """Static cameras under the names of the recording, where both are numbered: int_cam1_img, cam01."""
    if set(stations) & set(cameras):
        return stations
    numbers = [{name: _number(name) for name in names} for names in (stations, cameras)]
    ours, theirs = ({number: name for name, number in named.items() if number is not None} for named in numbers)
    if any(len(known) < len(named) for known, named in zip((ours, theirs), numbers, strict=True)):
        return stations
    pairs = {theirs[number]: ours[number] for number in theirs if number in ours}
    if pairs:
        listed = ", ".join(f"{camera} is {name}" for camera, name in pairs.items())
        logger.warning("%s: cameras are matched by the numbers in their names: %s", path, listed)
    return {camera: replace(stations[name], name=camera) for camera, name in pairs.items()} or stations


def _number(name: str) -> int | None:
    digits = re.findall(r"\d+", name)
    return int(digits[0]) if len(digits) == 1 else None


def _other_lens(file: Path, station: StaticCamera, recording: Recording) -> str:
    """What is said of a static camera whose lens in a recording is another one; empty if it is not."""
    try:
        recorded = recording.camera_model(station.name)
    except LensError:
        return ""
    ours = station.camera
    scale = recorded.width / ours.width
    off = abs(recorded.fx / (scale * ours.fx) - 1.0)
    if off > _OTHER_LENS or (recorded.width, recorded.height) != (ours.width, ours.height):
        return (
            f"camera {station.name}: {file} has a focal length of {ours.fx:g} px for {ours.width} x {ours.height}, "
            f"{recording.path} (camera_info) {recorded.fx:g} px for {recorded.width} x {recorded.height}; the first is "
            "used"
        )
    return ""


@dataclass(frozen=True)
class UnplacedCamera:
    """A static camera whose pose was not found.

    Attributes:
        name: of the camera.
        reason: why, and what to do.
    """

    name: str
    reason: str


def place_static_cameras(
    recording: Recording, cameras: Sequence[str], reference_map: ReferenceMap, settings: StaticCamerasSettings
) -> Iterator[RegisteredStaticCamera | UnplacedCamera]:
    """Register static cameras in a map, in their order.

    Args:
        recording: with their images.
        cameras: their names.
        reference_map: the map.
        settings: of all steps.
    """
    for name in cameras:
        try:
            camera = recording.camera_model(name)
            images = _spread_images(recording, camera, _IMAGES)
            yield StaticCameraRegistration(camera, reference_map, settings).register(images)
        except (LensError, RecordingError, StaticCameraError) as error:
            yield UnplacedCamera(name, str(error))


def _spread_images(recording: Recording, camera: CameraModel, count: int) -> list[NDArray[np.uint8]]:
    """Some images (H, W) of a camera, grey, from its first to its last.

    Raises:
        RecordingError: none can be used.
    """
    last = recording.image_count(camera.name) - 1
    wanted = set(np.linspace(0, max(0, last), count).round().astype(int).tolist())
    images, refused = [], ""
    for number, image in enumerate(recording.images([camera.name])):
        if number not in wanted:
            continue
        try:
            grey = decode_grey(image)
        except RecordingError as error:
            refused = str(error)
            continue
        if grey.shape == (camera.height, camera.width):
            images.append(grey)
            continue
        refused = f"camera {camera.name}: {size_mismatch((camera.width, camera.height), grey.shape[::-1])}"
    if not images:
        raise RecordingError(refused or f"camera {camera.name}: {recording.path} has no image of it")
    return images
