"""What one camera of a recording saw: its images, and the landmarks that were found in them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.evaluate.read_solved import LANDMARKS
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.view.motion import nearest

MOST_BYTES = 400_000_000
"""Of compressed images that are kept in memory; of a longer recording every second image is kept, or every fourth."""


@dataclass(frozen=True, eq=False)
class Footage:
    """One camera's images, in order of time.

    Attributes:
        camera: its name.
        model: its lens.
        stamps_ns: (K,) of the images, increasing [ns].
        images: K of them.
        matches: stamp [ns] -> landmarks found in the image of that stamp, where OUT has them.
    """

    camera: str
    model: CameraModel
    stamps_ns: NDArray[np.int64]
    images: tuple[CameraImage, ...]
    matches: dict[int, LandmarkMatches]

    def image_at(self, at_ns: int, within_ns: int) -> CameraImage | None:
        """The image nearest to a time, if there is one so near."""
        row = nearest(self.stamps_ns, at_ns, within_ns)
        return None if row is None else self.images[row]


def read_footage(recording: Path, solved: Path | None, camera: str, is_wanted: Callable[[], bool]) -> Footage | None:
    """Read all images of one camera; None as soon as they are not wanted any more.

    Args:
        recording: bag with images.
        solved: bag with landmarks.
        camera: name.
        is_wanted: asked now and then.

    Raises:
        RecordingError: a bag is damaged, or the recording has no such camera.
        LensError: the camera's intrinsics cannot be used.
    """
    kept: list[CameraImage] = []
    size, every = 0, 1
    with open_recording(recording) as bag:
        model = bag.camera_model(camera)
        for number, image in enumerate(bag.images([camera])):
            if not is_wanted():
                return None
            if number % every:
                continue
            kept.append(image)
            size += _size(image)
            if size > MOST_BYTES:
                kept, every = kept[::2], 2 * every
                size = sum(_size(image) for image in kept)
    stamps_ns = np.array([image.stamp_ns for image in kept], dtype=np.int64)
    return Footage(camera, model, stamps_ns, tuple(kept), _matches(solved, camera))


def _matches(solved: Path | None, camera: str) -> dict[int, LandmarkMatches]:
    if solved is None:
        return {}
    with BagFile(solved) as bag:
        stream = (landmark_matches(message, camera) for _, _, message in bag.messages([f"/{camera}{LANDMARKS}"]))
        return {matches.stamp_ns: matches for matches in stream}


def _size(image: CameraImage) -> int:
    content = image.content
    return content.nbytes if isinstance(content, np.ndarray) else len(content) if isinstance(content, bytes) else 0
