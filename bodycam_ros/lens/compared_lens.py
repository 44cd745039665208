"""Whether the lens that a carried camera is said to have fits what it saw."""

import logging
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.lens_match import lens_match
from bodycam_ros.lens.lens_watch import followed_pairs
from bodycam_ros.mapping.moving_camera import Frame, MovingCamera

logger = logging.getLogger(__name__)

_PAIRS, _MOST_FRAMES = 8, 900


def compare_lens(source: MovingCamera) -> None:
    """Warn of a lens that the recording's own points contradict: no map would come of it."""
    with source.frames() as frames:
        match = lens_match(source.camera, list(followed_pairs(_pictures(frames), _PAIRS)))
    if not match.matches:
        logger.warning("%s: %s", source.name, match.text)


def _pictures(frames: Iterator[Frame]) -> Iterator[NDArray[np.uint8]]:
    for frame in islice(frames, _MOST_FRAMES):
        with suppress(RecordingError):
            yield frame.grey()
