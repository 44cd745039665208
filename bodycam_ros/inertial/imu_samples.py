"""Samples of an inertial sensor: angular velocity and acceleration in its own frame (REP-145)."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

GRAVITY = 9.80665  # [m/s^2]


@dataclass(frozen=True, eq=False)
class ImuSamples:
    """N samples in order of their stamps.

    Attributes:
        stamps_ns: (N,) by the sensor's clock [ns].
        angular_velocity: (N, 3) in the sensor's frame [rad/s].
        acceleration: (N, 3) specific force in the sensor's frame [m/s^2]: at rest it points up.
        not_finite, unordered: counts of samples that are not finite numbers, and whose stamp does not increase; they
            are left out.
    """

    stamps_ns: NDArray[np.int64]
    angular_velocity: Array
    acceleration: Array
    not_finite: int = 0
    unordered: int = 0

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @staticmethod
    def from_rows(rows: Iterable[tuple[int, tuple[float, ...]]]) -> "ImuSamples":
        """Samples of rows (stamp [ns], three angular velocities and three accelerations).

        Samples that are not finite, or whose stamp does not increase, are left out.
        """
        kept = [*rows]
        stamps_ns = np.array([stamp_ns for stamp_ns, _ in kept], np.int64)
        values = np.fromiter(chain.from_iterable(row for _, row in kept), np.float64, 6 * len(kept))
        readings = values.reshape(-1, 6)
        is_finite = np.isfinite(readings).all(axis=1)
        stamps_ns, readings = stamps_ns[is_finite], readings[is_finite]
        later = np.diff(np.maximum.accumulate(stamps_ns), prepend=-1) > 0
        counts = int(np.sum(~is_finite)), int(np.sum(~later))
        return ImuSamples(stamps_ns[later], readings[later, :3], readings[later, 3:], *counts)

    @property
    def left_out(self) -> str:
        """How many samples are left out, and why; empty if none is."""
        reasons = {"are not finite numbers": self.not_finite, "have a stamp that does not increase": self.unordered}
        return ", ".join(f"{count} samples {reason}" for reason, count in reasons.items() if count)

    def between(self, start_ns: int, end_ns: int) -> "ImuSamples":
        """Samples from start to end [ns], the end included."""
        rows = slice(*np.searchsorted(self.stamps_ns, [start_ns, end_ns + 1]).tolist())
        return ImuSamples(self.stamps_ns[rows], self.angular_velocity[rows], self.acceleration[rows])
