"""Which lenses of a recording are not those that it was made with."""

from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.lens_match import LensMatch, lens_match
from bodycam_ros.lens.lens_watch import followed_pairs
from bodycam_ros.recording.bag_reader import Recording, open_recording

_PAIRS, _MOST_IMAGES = 8, 300


def other_lenses(path: Path, cameras: Collection[str]) -> Iterator[LensMatch]:
    """What points of a bag say against the lenses of those of some cameras that it has; some seconds each.

    Raises:
        RecordingError: not a bag.
    """
    with open_recording(path) as recording:
        for camera in cameras:
            if camera not in recording.cameras:
                continue
            pictures = islice(_pictures(recording, camera), _MOST_IMAGES)
            match = lens_match(recording.camera_model(camera), list(followed_pairs(pictures, _PAIRS)))
            if not match.matches:
                yield match


def _pictures(recording: Recording, camera: str) -> Iterator[NDArray[np.uint8]]:
    """Those of the size that the lens is for; of another size the tracker has complained."""
    model = recording.camera_model(camera)
    for image in recording.images([camera]):
        try:
            grey = decode_grey(image)
        except RecordingError:
            continue
        if grey.shape == (model.height, model.width):
            yield grey
