"""A camera's recording as a folder of images, one file a frame."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.sound import SoundBlock
from bodycam_ros.recording.video_file import FileFacts

IMAGE_SUFFIXES = frozenset({".jpg", ".jpeg", ".png"})
"""Files that ``sensor_msgs/CompressedImage`` takes as they are."""

_STAMP_DIGITS = 16  # a file's name of as many digits or more may be a stamp in nanoseconds
_LATEST_NS = (1 << 63) - 1
_SHORTEST_NS = 100_000  # between images: numbers that differ by less are no nanoseconds, but as the digits of a date


@dataclass(frozen=True)
class ImageFolder:
    """Images of one camera, with what ``CameraVideo`` has.

    Attributes:
        camera: its name.
        paths: the images, in order.
        times_s: (N,) media times, the first 0 [s].
        facts: of the images.
    """

    camera: str
    paths: tuple[Path, ...]
    times_s: NDArray[np.float64]
    facts: FileFacts

    @classmethod
    def from_files(cls, camera: str, paths: Sequence[Path], rate_hz: float | None) -> "ImageFolder":
        """Images named by stamps in nanoseconds, or in the order of their names at a rate.

        Raises:
            RecordingError: an image cannot be read, two have one stamp, or there is neither a rate nor a stamp in each
                name.
        """
        if stamps := _stamps_ns(paths):
            paths = sorted(paths, key=stamps.__getitem__)
            for image, later in pairwise(paths):
                if stamps[image] == stamps[later]:
                    raise RecordingError(f"{image} and {later.name} have the same stamp; remove one of them")
            times_s = 1e-9 * np.array([stamps[path] - stamps[paths[0]] for path in paths])
            created: datetime | None = datetime.fromtimestamp(1e-9 * stamps[paths[0]], UTC)
        elif rate_hz is not None:
            times_s, created = np.arange(len(paths)) / rate_hz, None
        else:
            raise RecordingError(
                f"{paths[0].parent}: images have no time; give their rate with --rate, or name them by their stamps "
                "in nanoseconds"
            )
        height, width = read_image_file(paths[0], cv2.IMREAD_COLOR).shape[:2]
        interval_s = float(np.median(np.diff(times_s))) if len(paths) > 1 else 1.0
        duration_s = float(times_s[-1]) + interval_s
        facts = FileFacts("images", width, height, duration_s, len(paths), 1.0 / interval_s, created=created)
        return cls(camera, tuple(paths), times_s, facts)

    @property
    def path(self) -> Path:
        """The folder."""
        return self.paths[0].parent

    def files(self) -> Iterator[tuple[float, str, bytes]]:
        """Media time [s], format (jpeg or png) and content of each image."""
        for media_s, path in zip(self.times_s.tolist(), self.paths, strict=True):
            yield media_s, "png" if path.suffix.lower() == ".png" else "jpeg", path.read_bytes()

    def frames(self, threads: int = 0) -> Iterator[tuple[float, av.VideoFrame]]:
        """The images, decoded: media time [s] and frame."""
        for media_s, path in zip(self.times_s.tolist(), self.paths, strict=True):
            yield media_s, av.VideoFrame.from_ndarray(read_image_file(path, cv2.IMREAD_COLOR), format="bgr24")

    def sound(self) -> Iterator[SoundBlock]:
        """None: images have no sound."""
        return iter(())


def _stamps_ns(paths: Sequence[Path]) -> dict[Path, int]:
    """The stamp of each image by its name [ns]; empty where names are none."""
    if not all(path.stem.isdecimal() and len(path.stem) >= _STAMP_DIGITS for path in paths):
        return {}
    stamps = {path: int(path.stem) for path in paths}
    first, last = min(stamps.values()), max(stamps.values())
    is_too_fast = last > first and last - first < _SHORTEST_NS * (len(set(stamps.values())) - 1)
    return {} if last > _LATEST_NS or is_too_fast else stamps
