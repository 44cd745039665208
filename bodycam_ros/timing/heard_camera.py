"""What is known of one camera while its clock is watched."""

import math
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_state import ClockState
from bodycam_ros.timing.intervals import Intervals


@dataclass
class HeardCamera:
    """One camera: what is held, what may still be learned from, its clocks since the beginning, its intervals."""

    held: deque[LandmarkMatches] = field(default_factory=deque)
    images: deque[LandmarkMatches] = field(default_factory=deque)
    clocks: list[ClockState] = field(default_factory=list)
    intervals: Intervals = field(default_factory=Intervals)
    first_ns: int = -1
    latest_ns: int = -1
    passed: tuple[int, int] = (-1, -1)
    readout_time: float = math.nan
    readout_sigma: float = math.nan

    def begin_anew(self) -> None:
        """Its time goes back: only what is known of its clock stays."""
        self.images.clear()
        self.intervals = Intervals()
        self.first_ns = self.latest_ns = -1
        self.clocks = [replace(clock, since_ns=0) for clock in self.clocks[-1:]]

    def stamps_ns(self, from_ns: int = 0) -> NDArray[np.int64]:
        """Stamps (N) of the latest images [ns]."""
        return np.array([image.stamp_ns for image in self.images if image.stamp_ns >= from_ns], np.int64)
