"""What one camera of a recording saw: its images, and the landmarks that were found in them.

They are read on a thread, without keeping the view waiting.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, FilePicture, RawPicture, VideoPacket
from bodycam_ros.errors import BodycamError
from bodycam_ros.geometry import Array
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_decoder import decode_last
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.topics import read_clock, read_landmarks
from bodycam_ros.viewer.inbox import Inbox

MOST_BYTES = 400_000_000
"""Of compressed images that are kept in memory; of a longer recording every second image is kept, or every fourth.

Of a video the keyframes are kept first, and then every second of them: no other frame can be left out.
"""


@dataclass(frozen=True, eq=False)
class Footage:
    """One camera's images, in order of time.

    Attributes:
        camera: its name.
        model: its lens.
        times_ns: (K,) of the images, increasing: their stamps, corrected by what the body told of the clock [ns].
        images: K of them, frames of a video as packets.
        matches: stamp [ns] -> landmarks found in the image of that stamp, where OUT has them.
    """

    camera: str
    model: CameraModel
    times_ns: NDArray[np.int64]
    images: tuple[CameraImage, ...]
    matches: dict[int, LandmarkMatches]

    def image_at(self, at_ns: int, within_ns: int) -> CameraImage | None:
        """The image nearest to a time, if there is one so near; of a video, decoded from the keyframe before it on."""
        row = nearest(self.times_ns, at_ns, within_ns)
        if row is None:
            return None
        start = row
        while start > 0 and not _stands_alone(self.images[start]):
            start -= 1
        return decode_last(self.images[start : row + 1])


def read_footage(recording: Path, solved: Path | None, camera: str, is_wanted: Callable[[], bool]) -> Footage | None:
    """Read all images of one camera; None as soon as they are not wanted any more.

    Args:
        recording: bag with images.
        solved: bag with landmarks and clocks.
        camera: name.
        is_wanted: asked now and then.

    Raises:
        RecordingError: a bag is damaged, or the recording has no such camera.
        LensError: the camera's intrinsics cannot be used.
    """
    kept = _Kept()
    with open_recording(recording) as bag:
        model = bag.camera_model(camera)
        for image in bag.encoded_images([camera]):
            if not is_wanted():
                return None
            kept.add(image)
    times_ns = np.array([image.stamp_ns for image in kept.images], dtype=np.int64)
    if solved is not None and (clock := read_clock(solved, camera)):
        times_ns = np.maximum.accumulate(clock.corrected_ns(times_ns))
    found = () if solved is None else read_landmarks(solved, (camera,))
    matches = {matches.stamp_ns: matches for matches in found}
    return Footage(camera, model, times_ns, tuple(kept.images), matches)


class _Kept:
    """Images, few enough for ``MOST_BYTES``."""

    def __init__(self) -> None:
        self.images: list[CameraImage] = []
        self._bytes = 0
        self._only_keys = False
        self._every, self._number = 1, 0

    def add(self, image: CameraImage) -> None:
        """Keep an image, or not, as its predecessors were."""
        if self._only_keys and not _stands_alone(image):
            return
        self._number += 1
        if (self._number - 1) % self._every:
            return
        self.images.append(image)
        self._bytes += _size(image)
        if self._bytes > MOST_BYTES:
            self._thin_out()

    def _thin_out(self) -> None:
        if self._only_keys or all(map(_stands_alone, self.images)):
            self.images, self._every = self.images[::2], 2 * self._every
        else:
            self.images, self._only_keys = [image for image in self.images if _stands_alone(image)], True
            self._number = len(self.images)
        self._bytes = sum(map(_size, self.images))


def _stands_alone(image: CameraImage) -> bool:
    return not isinstance(image.content, VideoPacket) or image.content.is_key


def _size(image: CameraImage) -> int:
    content = image.content
    if isinstance(content, VideoPacket):
        return len(content.data)
    if isinstance(content, np.ndarray | RawPicture | FilePicture):
        return content.nbytes
    return len(content) if isinstance(content, bytes) else 0


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


@dataclass(frozen=True)
class Detail:
    """What a picture may be made of.

    Attributes:
        faces: of each mesh on a segment, at most.
        landmarks: of the map, at most.
        resolution: pixels drawn for each of the window's, along one side; None: as the browser likes.
    """

    faces: int
    landmarks: int
    resolution: float | None

    @property
    def page(self) -> str:
        """What the address of the page ends in."""
        return "" if self.resolution is None else f"/?fixedDpr={self.resolution:g}"

    def mesh(self, vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
        """A mesh (V, 3) [m], (F, 3) with as many faces as are drawn, of the same shape as nearly as they allow."""
        if len(faces) <= self.faces:
            return vertices, faces
        fewer = fast_simplification.simplify(vertices.astype(np.float32), faces, target_count=self.faces)
        return fewer[0].astype(np.float64), fewer[1].astype(np.int32)

    def chosen(self, landmarks: int) -> slice:
        """Which of so many landmarks are drawn: they are spread evenly over the map's order, which is nobody's."""
        return slice(None, None, -(-landmarks // self.landmarks) or 1)


FINE = Detail(faces=400, landmarks=100_000, resolution=None)
COARSE = Detail(faces=80, landmarks=4_000, resolution=0.4)
