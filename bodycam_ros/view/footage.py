"""What one camera of a recording saw: its images, and the landmarks that were found in them.

They are read on a thread, without keeping the view waiting.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import BodycamError
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solved.topics import read_landmarks
from bodycam_ros.solved.trajectory import nearest
from bodycam_ros.view.inbox import Inbox

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
    found = () if solved is None else read_landmarks(solved, (camera,))
    matches = {matches.stamp_ns: matches for matches in found}
    return Footage(camera, model, stamps_ns, tuple(kept), matches)


def _size(image: CameraImage) -> int:
    content = image.content
    return content.nbytes if isinstance(content, np.ndarray) else len(content) if isinstance(content, bytes) else 0


class FootageLoader:
    """Reads one camera at a time; of several that are asked for in a row, the last.

    Attributes:
        footage: of the camera asked for, once it is there.
    """

    def __init__(
        self,
        recording: Path,
        solved: Path | None,
        inbox: Inbox,
        on_loaded: Callable[[], None],
        on_error: Callable[[BodycamError], None],
    ) -> None:
        self.footage: Footage | None = None
        self._recording = recording
        self._solved = solved
        self._inbox = inbox
        self._on_loaded = on_loaded
        self._on_error = on_error
        self._wanted: str | None = None

    def ask(self, camera: str | None) -> None:
        """Begin to read a camera, or forget them all."""
        if camera == self._wanted:
            return
        self._wanted, self.footage = camera, None
        if camera is not None:
            threading.Thread(target=self._read, args=(camera,), daemon=True).start()

    def _read(self, camera: str) -> None:
        try:
            footage = read_footage(self._recording, self._solved, camera, lambda: self._wanted == camera)
        except BodycamError as error:
            failed = error
            self._inbox.put(lambda: self._on_error(failed))
            return
        if footage is not None:
            self._inbox.put(lambda: self._loaded(footage))

    def _loaded(self, footage: Footage) -> None:
        if footage.camera == self._wanted:
            self.footage = footage
            self._on_loaded()
