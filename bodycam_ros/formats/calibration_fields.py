"""Fields of a calibration as files have them: numbers of a shape, rotations, and the size of images beside the file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import RecordingError, StaticCameraError
from bodycam_ros.files.shown import shown
from bodycam_ros.geometry import Array, nearest_rotation

_IMAGES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff")
_VIDEOS = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v")


def rotation_of(value: Any, where: str, tolerance: float) -> Array:
    """The rotation (3, 3) of nine numbers, whose columns may be off by a tolerance.

    Raises:
        StaticCameraError: it is none.
    """
    R = numbers_of_shape(value, (3, 3), where)
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    if off > tolerance or np.linalg.det(R) < 0.0:
        what = "it mirrors" if off <= tolerance else f"its columns are off by {off:.2g}"
        raise StaticCameraError(f"{where}: expected a rotation, three orthogonal axes of length 1; {what}")
    return nearest_rotation(R)


def numbers_of_shape(value: Any, shape: Sequence[int], where: str) -> Array:
    """Finite numbers of a shape.

    Raises:
        StaticCameraError: they are missing, or something else.
    """
    try:
        numbers = np.array(value, np.float64).reshape(shape)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full(1, np.nan)
    if not np.isfinite(numbers).all():
        expected = " x ".join(map(str, shape)) if tuple(shape) != (-1,) else "some"
        raise StaticCameraError(f"{where}: expected {expected} numbers, not {shown(value)}")
    return numbers


def size_of_images(file: Path, name: str) -> list[int] | None:
    """Width and height [px] of a camera's images beside its calibration; None where there are none.

    They lie as EasyMocap and others have them: ``images/NAME/*.jpg``, ``videos/NAME.mp4``, ``NAME/*.jpg`` or
    ``NAME.mp4``, in the folder of the file.
    """
    if not name or "/" in name or name in (".", ".."):
        return None
    for folder in (file.parent / "images" / name, file.parent / name):
        if folder.is_dir():
            for image in sorted(each for each in folder.iterdir() if each.suffix.lower() in _IMAGES)[:1]:
                try:
                    height, width = read_image_file(image, cv2.IMREAD_GRAYSCALE).shape[:2]
                except RecordingError:
                    break
                return [width, height]
    for folder in (file.parent / "videos", file.parent):
        for video in (folder / f"{name}{suffix}" for suffix in _VIDEOS):
            if video.is_file():
                capture = cv2.VideoCapture(str(video))
                width, height = (int(capture.get(key)) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
                capture.release()
                if width and height:
                    return [width, height]
    return None
