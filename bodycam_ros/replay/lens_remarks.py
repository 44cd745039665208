"""What a replay says of lenses that are not those that the recording was made with."""

from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.lens.followed_points import followed_pairs
from bodycam_ros.lens.lens_match import lens_match
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.replay.replay_summary import ReplaySummary

_PAIRS, _MOST_IMAGES = 8, 300
_WELL_REGISTERED = 0.6
"""Share of its images that a camera with the right lens is registered on, unless it is covered."""


def doubted_cameras(summary: ReplaySummary) -> tuple[str, ...]:
    """Cameras that were registered so seldom, or contradict so much, that their lens may be another's."""
    accused = {finding.camera for finding in summary.verdict.findings if finding.part == "camera"}
    return tuple(
        camera
        for camera, images in sorted(summary.images.items())
        if camera in accused or summary.registered[camera] < _WELL_REGISTERED * images
    )


def lens_remarks(path: Path, cameras: Collection[str]) -> list[str]:
    """A line for each of these cameras of a recording whose own points say that its lens is another."""
    lines = []
    with open_recording(path) as recording:
        for camera in cameras:
            pictures = islice(_pictures(recording, camera), _MOST_IMAGES)
            match = lens_match(recording.camera_model(camera), list(followed_pairs(pictures, _PAIRS)))
            if not match.matches:
                lines.append(match.text)
    return lines


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
