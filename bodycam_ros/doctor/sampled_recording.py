"""A recording as the checks know it: the times of all images, and some of the images themselves."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.tracking.view_mask import view_mask

Grey = NDArray[np.uint8]

Instants = Callable[[float], Array]
"""Duration of a recording [s] -> (K,) the instants at which to look into it [s]."""

_WIDEST_DEG = 90.0
"""Fisheye pictures are black farther out."""


@dataclass(frozen=True, eq=False)
class SampledCamera:
    """One camera.

    Attributes:
        name: of the camera.
        lens: its model; None if there is none that can be used.
        lens_fault: why.
        stamps_s: (N,) of its images as they were recorded, since the recording's start [s].
        recorded_s: (N,) when they were recorded, likewise; the same as the stamps where nobody knows.
        images: number of an instant -> (H, W) the image nearest to it; instants without one are left out.
        fault: why images that should be there cannot be decoded; empty if they can.
        missing: images that the recording says it holds, but does not.
        has_sound: whether its video has sound; None if it is no video file.
    """

    name: str
    lens: CameraModel | None
    lens_fault: str
    stamps_s: Array
    recorded_s: Array
    images: Mapping[int, Grey]
    fault: str = ""
    missing: int = 0
    has_sound: bool | None = None

    @property
    def interval_s(self) -> float:
        """Between two images, median [s]; NaN where there are no two."""
        steps = np.diff(np.sort(self.stamps_s))
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else float("nan")

    @cached_property
    def lit(self) -> Grey | None:
        """(H, W) 255 where the lens draws a picture; None where nobody knows, or images have another size."""
        sizes = {grey.shape for grey in self.images.values()}
        if self.lens is None or sizes - {(self.lens.height, self.lens.width)}:
            return None
        return view_mask(self.lens, _WIDEST_DEG)


@dataclass(frozen=True, eq=False)
class SampledRecording:
    """All cameras.

    Attributes:
        path: of the recording.
        cameras: by name.
        duration_s: of the recording [s].
        instants_s: (K,) instants of the sampled images, since the start [s].
        is_synchronous: whether stamps of different cameras are of one time, as in a bag; videos are brought to it by
            ``bodycam ingest``.
        left_out: cameras that cannot be read, and why.
    """

    path: Path
    cameras: tuple[SampledCamera, ...]
    duration_s: float
    instants_s: Array
    is_synchronous: bool
    left_out: tuple[str, ...] = ()


def spread_instants(duration_s: float, count: int) -> Array:
    """(K,) instants, evenly over a recording, in the middle of equal parts [s]."""
    return (np.arange(count) + 0.5) * duration_s / count
