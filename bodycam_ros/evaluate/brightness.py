"""How bright each camera's images are over time: gain and exposure that drift, a lens in the dark."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.solved.solved_recording import SolvedRecording

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
