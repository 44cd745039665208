"""The static cameras of a recording in a reference map, each by some of its own images."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.camera.other_size import mode_of_size
from bodycam_ros.errors import LensError, RecordingError, StationError
from bodycam_ros.outside.station_registration import RegisteredStation, StationRegistration
from bodycam_ros.outside.station_settings import StationsSettings
from bodycam_ros.recording.bag_reader import Recording
from bodycam_ros.registration.reference_map import ReferenceMap


@dataclass(frozen=True)
class UnplacedCamera:
    """A camera whose place was not found.

    Attributes:
        name: of the camera.
        reason: why, and what to do.
    """

    name: str
    reason: str


def place_stations(
    recording: Recording, cameras: Sequence[str], reference_map: ReferenceMap, settings: StationsSettings
) -> Iterator[RegisteredStation | UnplacedCamera]:
    """Yield what became of each camera, in their order.

    Args:
        recording: that holds them.
        cameras: names of those that stand.
        reference_map: the map.
        settings: of all steps.
    """
    for name in cameras:
        try:
            camera = recording.camera_model(name)
            images = _spread_images(recording, camera, settings.stations.images)
            yield StationRegistration(camera, reference_map, settings).register(images)
        except (LensError, RecordingError, StationError) as error:
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
        refused = (
            f"camera {camera.name}: its images have {grey.shape[1]} x {grey.shape[0]} px, but its camera_info says "
            f"{camera.width} x {camera.height}, {mode_of_size((camera.width, camera.height), grey.shape[::-1])}"
        )
    if not images:
        raise RecordingError(refused or f"camera {camera.name}: {recording.path} holds no image of it")
    return images
