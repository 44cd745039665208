"""Pictures of a board: images, or of a video the sharpest frame of each part."""

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import LensError
from bodycam_ros.mapping.frame_choice import sharpness
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.video_file import DecodedFrame

logger = logging.getLogger(__name__)

Grey = NDArray[np.uint8]

_IMAGES = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm"}
_MOST_PICTURES = 120  # of a video, the sharpest of as many equal parts of it
_LIT = 24  # grey level of what a lens shows; a fisheye has black around it
_MOST_NAMED = 8
_MOST_BYTES = 700_000_000  # of pictures in memory at a time


@dataclass(frozen=True)
class LensImage:
    """A grey picture (H, W) and what to call it."""

    name: str
    grey: Grey


def lens_images(sources: Sequence[Path]) -> list[LensImage]:
    """Pictures of videos, of images and of folders with images, all of one size, each with a name of its own.

    Where sizes differ, those of the size that most have are taken, and a warning names the others.

    Raises:
        LensError: there is none, or as many have one size as another.
        RecordingError: one cannot be read.
    """
    images: list[Path] = []
    pictures: list[LensImage] = []
    for source in dict.fromkeys(sources):
        if not source.exists():
            raise LensError(f"{source}: no such file or folder; give a video or images of the board")
        if source.is_dir():
            images += sorted(p for p in source.iterdir() if p.suffix.lower() in _IMAGES)
        elif source.suffix.lower() in _IMAGES:
            images.append(source)
        else:
            alike = sum(other.name == source.name for other in dict.fromkeys(sources))
            pictures += _of_video(source, source.name if alike == 1 else str(source))
    images = list(dict.fromkeys(images))  # one may be given by itself and by its folder
    if images:
        most = max(2, min(_MOST_PICTURES, _MOST_BYTES // max(1, read_image_file(images[0], cv2.IMREAD_GRAYSCALE).size)))
        if len(images) > most:
            images = [images[row] for row in np.linspace(0, len(images) - 1, most).round().astype(int).tolist()]
        called = Counter(path.name for path in images)
        pictures += [
            LensImage(path.name if called[path.name] == 1 else str(path), read_image_file(path, cv2.IMREAD_GRAYSCALE))
            for path in images
        ]
    if not pictures:
        raise LensError(f"{', '.join(map(str, sources))}: no pictures; give a video, images (jpg, png) or their folder")
    return _of_one_size(pictures)


def _of_one_size(pictures: list[LensImage]) -> list[LensImage]:
    """The pictures of the size that most have."""
    sizes = Counter(_describe(picture) for picture in pictures)
    (most, count), *others = sizes.most_common()
    if not others:
        return pictures
    first, other = (next(p.name for p in pictures if _describe(p) == size) for size in (most, others[0][0]))
    if others[0][1] == count:
        raise LensError(
            f"{first} has {most} pixels, but {other} has {others[0][0]}, and {count} pictures each are so; a lens is "
            "measured in one mode of a camera: give pictures of one size"
        )
    left_out = [picture for picture in pictures if _describe(picture) != most]
    logger.warning(
        "%d of %d pictures are not used, since most have %s pixels: %s",
        len(left_out),
        len(pictures),
        most,
        ", ".join(f"{picture.name} ({_describe(picture)})" for picture in left_out[:_MOST_NAMED])
        + (", ..." if len(left_out) > _MOST_NAMED else ""),
    )
    return [picture for picture in pictures if _describe(picture) == most]


def illuminated_pixels(pictures: Sequence[LensImage]) -> NDArray[np.bool_]:
    """Which pixels (H, W) are ever lit: a fisheye may show a disc with black around it."""
    height, width = pictures[0].grey.shape
    size = (max(1, width // 8), max(1, height // 8))
    brightest = np.max([cv2.resize(p.grey, size, interpolation=cv2.INTER_AREA) for p in pictures], axis=0)
    shown = (brightest > _LIT).astype(np.uint8)
    full = cv2.resize(shown, (width, height), interpolation=cv2.INTER_NEAREST).astype(bool)
    return np.asarray(full, np.bool_)


def _of_video(path: Path, name: str) -> Iterator[LensImage]:
    video = CameraVideo.of_files(path.stem, [path])
    facts = video.facts
    most = max(2, min(_MOST_PICTURES, _MOST_BYTES // (facts.width * facts.height)))
    length = max(1, -(-facts.about_frames // most))
    pictures = (
        LensImage(f"{name} at {seconds:.2f} s", DecodedFrame(frame, facts.rotation_deg).grey())
        for seconds, frame in video.frames()
    )
    for _, part in groupby(enumerate(pictures), lambda numbered: numbered[0] // length):
        yield max((picture for _, picture in part), key=lambda picture: sharpness(picture.grey))


def _describe(picture: LensImage) -> str:
    height, width = picture.grey.shape
    return f"{width} x {height}"
