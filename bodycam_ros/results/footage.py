"""The images of a recording's cameras at a time, and the landmarks that were matched in them."""

from contextlib import ExitStack
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.topics import read_clock, read_landmarks


class Footage:
    """Images by camera and time, each read when it is asked for; the recording stays open until ``close``.

    Args:
        recording: bag with images.
        solved: bag with landmarks and clocks.

    Raises:
        RecordingError: a bag is damaged.
    """

    def __init__(self, recording: Path, solved: Path | None) -> None:
        self._open = ExitStack()
        self._recording = self._open.enter_context(open_recording(recording))
        self._solved = solved
        self._times = self._recording.image_times()
        self.model = cache(self._recording.camera_model)
        self._clock = cache(lambda camera: None if solved is None else read_clock(solved, camera))
        self._matches = cache(self._read_matches)

    def close(self) -> None:
        """Close the recording: no image is read any more."""
        self._open.close()

    @property
    def cameras(self) -> tuple[str, ...]:
        """Cameras that have images."""
        return self._recording.cameras

    def times_ns(self, camera: str) -> NDArray[np.int64]:
        """(K,) of a camera's images: their stamps, corrected by its clock offset [ns]."""
        stamps_ns, clock = self._times[camera][:, 1], self._clock(camera)
        return stamps_ns if clock is None else clock.corrected_ns(stamps_ns)

    def image_at(self, camera: str, at_ns: int, within_ns: int) -> CameraImage | None:
        """The image nearest to a time, if there is one so near; of a video, decoded from the keyframe before it on.

        Raises:
            RecordingError: the bag is damaged, or the image cannot be decoded.
        """
        row = nearest(self.times_ns(camera), at_ns, within_ns)
        if row is None:
            return None
        recorded_ns, stamp_ns = self._times[camera][row].tolist()
        return self._recording.images_at({camera: (recorded_ns, stamp_ns)}).get(camera)

    def matches_of(self, image: CameraImage) -> LandmarkMatches | None:
        """Landmarks matched in an image, where the solved bag has them."""
        return self._matches(image.camera).get(image.stamp_ns)

    def _read_matches(self, camera: str) -> dict[int, LandmarkMatches]:
        found = () if self._solved is None else read_landmarks(self._solved, (camera,))
        return {matches.stamp_ns: matches for matches in found}
