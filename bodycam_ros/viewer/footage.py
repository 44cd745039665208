"""The images of one camera of a recording, and the landmarks that were matched in them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, FilePicture, RawPicture, VideoPacket
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
        times_ns: (K,) of the images, increasing: their stamps, corrected by the camera's clock offset [ns].
        images: K of them, frames of a video as packets.
        matches: stamp [ns] -> landmarks matched in the image of that stamp, where OUT has them.
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
        is_wanted: asked before each image.

    Raises:
        RecordingError: a bag is damaged, or the recording has no such camera.
        LensError: the camera's intrinsics cannot be used.
    """
    images: list[CameraImage] = []
    size, number, every, only_keyframes = 0, 0, 1, False
    with open_recording(recording) as bag:
        model = bag.camera_model(camera)
        for image in bag.encoded_images([camera]):
            if not is_wanted():
                return None
            if only_keyframes and not _stands_alone(image):
                continue
            if number % every == 0:
                images.append(image)
                size += _size(image)
            number += 1
            if size > MOST_BYTES:
                if all(map(_stands_alone, images)):
                    images, every = images[::2], 2 * every
                else:
                    images, only_keyframes = [kept for kept in images if _stands_alone(kept)], True
                    number = len(images)
                size = sum(map(_size, images))
    times_ns = np.array([image.stamp_ns for image in images], dtype=np.int64)
    if solved is not None and (clock := read_clock(solved, camera)):
        times_ns = np.maximum.accumulate(clock.corrected_ns(times_ns))
    found = () if solved is None else read_landmarks(solved, (camera,))
    return Footage(camera, model, times_ns, tuple(images), {matches.stamp_ns: matches for matches in found})


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
    """Reads one camera at a time, on a thread; of several requests the last counts.

    Attributes:
        footage: of the requested camera, once it is read.
    """

    def __init__(self, recording: Path, solved: Path | None, inbox: Inbox, on_loaded: Callable[[], None]) -> None:
        self.footage: Footage | None = None
        self._recording, self._solved = recording, solved
        self._inbox, self._on_loaded = inbox, on_loaded
        self._wanted: str | None = None

    def request(self, camera: str | None) -> None:
        """Start to read a camera, or none."""
        if camera == self._wanted:
            return
        self._wanted, self.footage = camera, None
        if camera is not None:
            self._inbox.compute(
                lambda: read_footage(self._recording, self._solved, camera, lambda: self._wanted == camera),
                self._take,
            )

    def _take(self, footage: Footage | None) -> None:
        if footage is not None and footage.camera == self._wanted:
            self.footage = footage
            self._on_loaded()
