"""Cameras of a recording, or of a video, whose images do not fit their calibration."""

import logging
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.lens_match import LensMatch
from bodycam_ros.lens.lens_watch import match_images
from bodycam_ros.mapping.moving_camera import Frame, MovingCamera
from bodycam_ros.recording.bag_reader import Recording, open_recording

logger = logging.getLogger(__name__)

_MOST_IMAGES, _MOST_FRAMES = 300, 900


def other_lenses(path: Path, cameras: Collection[str]) -> Iterator[LensMatch]:
    """Those of some cameras of a bag whose images do not fit their lens; some seconds each.

    Raises:
        RecordingError: not a bag.
    """
    with open_recording(path) as recording:
        for camera in cameras:
            if camera in recording.cameras:
                images = _images(recording, camera)
                match = match_images(recording.camera_model(camera), images, _MOST_IMAGES)
                if not match.matches:
                    yield match


def compare_lens(source: MovingCamera) -> None:
    """Warn of a lens that the points of a video contradict: no map would come of it."""
    with source.frames() as frames:
        match = match_images(source.camera, _grey_frames(frames), _MOST_FRAMES)
    if not match.matches:
        logger.warning("%s: %s", source.name, match.text)


def _grey_frames(frames: Iterable[Frame]) -> Iterator[NDArray[np.uint8]]:
    for frame in frames:
        with suppress(RecordingError):
            yield frame.grey()


def _images(recording: Recording, camera: str) -> Iterator[NDArray[np.uint8]]:
    """Those of the size that the lens is for; the tracker names others."""
    model = recording.camera_model(camera)
    for image in recording.images([camera]):
        with suppress(RecordingError):
            grey = decode_grey(image)
            if grey.shape == (model.height, model.width):
                yield grey
