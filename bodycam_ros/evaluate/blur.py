"""Registered share against blur.

The measure of blur is the motion of the picture between two images [px], by the tracks: times the share of that time
for which the shutter is open it is the blur, and nobody needs to know the exposure. Where every track ended, the motion
is that of the images next to it in time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.solved.camera_record import CameraRecord

EDGES_PX = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, np.inf)


@dataclass(frozen=True)
class BlurClass:
    """Images whose picture moved by about as much.

    Attributes:
        low_px, high_px: from and to below [px per image]; the last has no end.
        images: how many.
        registered: share of them with a pose.
        landmarks: mean of landmarks of those.
    """

    low_px: float
    high_px: float
    images: int
    registered: float
    landmarks: float


def image_motion(record: CameraRecord) -> Array:
    """Motion of a camera's picture (K,) [px per image], known everywhere if it is anywhere."""
    known = np.isfinite(record.image_motion)
    if not known.any():
        return np.full(len(known), np.nan)
    return np.interp(record.stamps_ns, record.stamps_ns[known], record.image_motion[known])


def blur_classes(records: Sequence[CameraRecord]) -> tuple[BlurClass, ...]:
    """The images of all cameras by how much their picture moved; classes without an image are left out."""
    if not records:
        return ()
    motion = np.concatenate([image_motion(record) for record in records])
    registered = np.concatenate([record.registered for record in records])
    landmarks = np.concatenate([record.landmarks for record in records])
    number = np.where(np.isfinite(motion), np.searchsorted(EDGES_PX, motion, side="right") - 1, -1)
    return tuple(
        _class(EDGES_PX[index], EDGES_PX[index + 1], registered[number == index], landmarks[number == index])
        for index in range(len(EDGES_PX) - 1)
        if (number == index).any()
    )


def _class(low_px: float, high_px: float, registered: NDArray[np.bool_], landmarks: NDArray[np.int64]) -> BlurClass:
    seen = landmarks[registered]
    return BlurClass(
        low_px, high_px, len(registered), float(registered.mean()), float(seen.mean()) if len(seen) else float("nan")
    )
