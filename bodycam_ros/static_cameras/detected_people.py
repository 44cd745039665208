"""People in images of static cameras, found by a detector: a start that nobody has to make, and evidence since then."""

import logging
from collections.abc import Callable, Iterable, Mapping
from itertools import islice

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.blazepose import Image, PoseDetector, Square
from bodycam_ros.static_cameras.keypoint_evidence import KeypointSource, People
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import decode_images
from bodycam_ros.timing.arrivals import frames_at_once

logger = logging.getLogger(__name__)

_START_FRAMES = 3
"""From the first on: one may have a joint that another hides. An image of 2 megapixels takes a second."""


class DetectedPeople(KeypointSource):
    """The person about whom a body is predicted, detected in each image: no search of the whole image is needed.

    Args:
        detector: of people.
    """

    def __init__(self, detector: PoseDetector) -> None:
        self._detector = detector

    def people(self, camera: str, stamp_ns: int, image: Image, near: Array) -> People:
        """See ``KeypointSource``; the person near (12, 2) predicted joints, or nobody."""
        square = Square.of_joints(near)
        found = None if square is None else self._detector.detect_in(image, square)
        return () if found is None else (found,)


def detect_start(
    images: Iterable[CameraImage],
    stations: Mapping[str, StaticCamera],
    on_progress: Callable[[float], None] = lambda share: None,
) -> dict[str, list[list[Array]]]:
    """Camera -> people in each of the first images, as ``formats.keypoints`` reads them.

    Args:
        images: of the static cameras, in order of time.
        stations: the cameras, by name.
        on_progress: called with the share of the images that is done.

    Raises:
        BodyError: no detector is installed.
    """
    unreadable: set[str] = set()
    decoded = (decode_images(frame.images, stations, unreadable) for frame in frames_at_once(images, stations))
    return detect_people(islice(decoded, _START_FRAMES), stations, lambda number: on_progress(number / _START_FRAMES))


def detect_people(
    frames: Iterable[Mapping[str, Image]],
    cameras: Iterable[str],
    on_frame: Callable[[int], None] = lambda number: None,
) -> dict[str, list[list[Array]]]:
    """Camera -> people in each of some frames; none in one that has no image of it.

    Args:
        frames: camera -> image (H, W, 3) of one time: blue, green, red.
        cameras: their names.
        on_frame: called with the number of frames that are done.

    Returns:
        (12, 3) of each person: pixel and score of shoulders, elbows, wrists, hips, knees, ankles, left before right.

    Raises:
        BodyError: no detector is installed.
    """
    detector = PoseDetector.installed()
    people: dict[str, list[list[Array]]] = {camera: [] for camera in cameras}
    for number, pictures in enumerate(frames, start=1):
        for camera, found in people.items():
            found.append(detector.detect(pictures[camera]) if camera in pictures else [])
        counts = ", ".join(f"{camera} {len(found[-1])}" for camera, found in people.items())
        logger.info("people in frame %d: %s", number, counts)
        on_frame(number)
    return people
