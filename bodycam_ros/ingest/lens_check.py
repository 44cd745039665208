"""Whether each camera recorded with the lens that it is said to have."""

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from threading import Event

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.ingest.side_by_side import for_each_camera
from bodycam_ros.lens.followed_points import followed_pairs
from bodycam_ros.lens.lens_match import LensMatch, lens_match
from bodycam_ros.video.video_frame import grey_pixels

_PAIRS = 8
_MOST_FRAMES = 900
"""A camera that lies still all that time is not waited for."""


def lens_remarks(cameras: Sequence[IngestCamera], on_progress: Callable[[int, int], None]) -> list[str]:
    """A line for each camera whose points say that its lens is another, with the likely mode.

    Args:
        cameras: all of them.
        on_progress: told how many are done, and of how many.
    """
    by_name = {camera.name: camera for camera in cameras}
    matches = for_each_camera(by_name, lambda name, ended: _match(by_name[name], ended), on_progress)
    return [matches[name].text for name in by_name if not matches[name].matches]


def _match(camera: IngestCamera, ended: Event) -> LensMatch:
    try:
        pairs = list(followed_pairs(_upright(camera, ended), _PAIRS))
    except RecordingError:  # named when it is written
        pairs = []
    return lens_match(camera.lens, pairs)


def _upright(camera: IngestCamera, ended: Event) -> Iterator[NDArray[np.uint8]]:
    turns = camera.video.facts.rotation_deg // 90
    for _, frame in islice(camera.video.frames(threads=1), _MOST_FRAMES):
        if ended.is_set():
            return
        yield np.ascontiguousarray(np.rot90(grey_pixels(frame), turns))
