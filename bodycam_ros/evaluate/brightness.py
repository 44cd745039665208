"""How bright each camera's images are over time: gain and exposure that drift, a lens in the dark.

The measure of blur is the motion of the picture between two images [px], by the tracks: times the share of that time
for which the shutter is open it is the blur, and nobody needs to know the exposure. Where every track ended, the motion
is that of the images next to it in time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.results.camera_record import CameraRecord
from bodycam_ros.results.solved_recording import SolvedRecording

_LATEST_S = 60.0
"""Images later than this are not looked at: bags are read from their start."""

_MOST_IMAGES = 60
_DARK, _SATURATED = 16, 250


@dataclass(frozen=True, eq=False)
class Brightness:
    """Of one camera, over N images.

    Attributes:
        seconds: (N,) since the start of the recording.
        level: (N,) the middle of the grey levels of what is neither black nor saturated, 0 to 255.
        saturated: (N,) share of the picture that is saturated.
    """

    seconds: Array
    level: Array
    saturated: Array

    @property
    def range(self) -> float:
        """The brightest over the darkest, leaving out a tenth at each end; 1 if the light stays."""
        low, high = np.percentile(self.level, (10, 90))
        return float(high / max(low, 1.0))


def brightness(solved: SolvedRecording, recording: Path) -> Mapping[str, Brightness]:
    """Camera -> its brightness, by images spread evenly over the first minute.

    Raises:
        RecordingError: not a recording.
    """
    end_ns = min(solved.end_ns, solved.start_ns + round(1e9 * _LATEST_S))
    step_ns = max((end_ns - solved.start_ns) // _MOST_IMAGES, 1)
    rows: dict[str, list[tuple[float, float, float]]] = {}
    due: dict[str, int] = {}
    with open_recording(recording) as images:
        names = (*(record.camera for record in solved.cameras), *(record.station for record in solved.stations))
        cameras = [name for name in names if name in images.cameras]
        for image in images.images(cameras):
            if image.stamp_ns > end_ns:
                break
            if image.stamp_ns < due.get(image.camera, 0):
                continue
            due[image.camera] = image.stamp_ns + step_ns
            try:
                grey = decode_grey(image)
            except RecordingError:  # the tracker has named it
                continue
            seconds = float(solved.seconds(np.array([image.stamp_ns]))[0])
            lit = grey[(grey >= _DARK) & (grey < _SATURATED)]
            level = float(np.median(lit)) if lit.size else float(grey.mean())
            rows.setdefault(image.camera, []).append((seconds, level, float((grey >= _SATURATED).mean())))
    return {camera: Brightness(*np.array(values).T) for camera, values in rows.items()}


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
