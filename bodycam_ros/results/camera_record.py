"""What the cameras of a solved recording measured, over their images."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.timing.clock_state import ClockHistory


@dataclass(frozen=True, eq=False)
class StationRecord:
    """One static camera over K images.

    Attributes:
        station: name.
        stamps_ns: (K,) of its images, increasing [ns].
        segments: (K,) how many segments it measured.
        confidence: (K,) mean over the segments that it searched for, 0 to 1; 0 where it searched for none.
    """

    station: str
    stamps_ns: NDArray[np.int64]
    segments: NDArray[np.int64]
    confidence: Array

    @property
    def observes(self) -> NDArray[np.bool_]:
        """(K,) whether it measured any segment."""
        observed: NDArray[np.bool_] = self.segments > 0
        return observed


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """One body camera over K images.

    Attributes:
        camera: name.
        stamps_ns: (K,) of its images, corrected by its clock, increasing [ns].
        landmarks: (K,) tracks that carry a landmark of the map.
        world_T_camera: (K, 4, 4) registered pose of the optical frame [m]; NaN without one.
        sights: (K,) a ``CameraSight`` each.
        timing: its clock; None in a bag without it.
    """

    camera: str
    stamps_ns: NDArray[np.int64]
    landmarks: NDArray[np.int64]
    world_T_camera: Array
    sights: NDArray[np.int64]
    timing: ClockHistory | None = None

    def time_of(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,) of images by the camera's own clock, as times of the recording [ns]."""
        return stamps_ns if self.timing is None else self.timing.corrected_ns(stamps_ns)

    @property
    def registered(self) -> NDArray[np.bool_]:
        """(K,) whether it has a pose."""
        known: NDArray[np.bool_] = np.isfinite(self.world_T_camera[:, 0, 0])
        return known
