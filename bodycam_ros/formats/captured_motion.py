"""A motion captured by another system: named points, and rotations of bones if it has them."""

import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from bodycam_ros.files.shown import shown
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.results.solved_body import GAP_FRAMES

logger = logging.getLogger(__name__)

MOST_BYTES = 1_000_000_000
"""Largest size of a file: an hour of 100 markers at 100 Hz has 0.9 GB."""

Y_UP_TO_Z_UP: Array = exp_so3(np.array([np.pi / 2.0, 0.0, 0.0]))
"""Rotation (3, 3) from a world with y up to one with z up; x stays."""

_FARTHEST = 1e9  # in any unit
_LATEST_S = 9e9  # stamps are nanoseconds in 64 bits
_RATE_DIFFERS = 0.02
_WHOLE = 0.999  # least weight of the known frames under a Gaussian
_MAX_GAP_FRAMES, _MAX_GAP_S = 2.5, 0.1  # points are interpolated between frames no further apart than the greater


@dataclass(frozen=True, eq=False)
class CapturedMotion:
    """A motion over K frames, in the world and by the clock of the system that captured it.

    Attributes:
        path: of the file or folder.
        kind: what it is: "TRC".
        stamps_ns: (K,) increasing [ns]; where the file has frame numbers alone, from 0 on.
        points: name -> (K, 3) [m], z up; NaN where missing.
        rotations: name -> (K, 3, 3) of a bone's axes in the world; of some points, or of none.
        parents: name -> its parent bone, if the file has it.
        has_unit: whether lengths are metres; otherwise their unit is unknown.

    Raises:
        ValueError: a point is farther away than on any recording, or a rotation is none.
    """

    path: Path
    kind: str
    stamps_ns: NDArray[np.int64]
    points: Mapping[str, Array]
    rotations: Mapping[str, Array] = field(default_factory=dict)
    parents: Mapping[str, str] = field(default_factory=dict)
    has_unit: bool = True

    def __post_init__(self) -> None:
        for name, points in self.points.items():
            if (np.abs(points) > _FARTHEST).any():
                raise ValueError(f"{shown(name)} is at {shown(float(np.nanmax(np.abs(points))))}, which is no place")
        for name, rotations in self.rotations.items():
            if not np.isfinite(rotations).all():
                raise ValueError(f"{shown(name)} has a rotation of numbers that are none, or too large")

    @property
    def frame_ns(self) -> float:
        """Mean time between two frames without a gap [ns]: times may be rounded, to milliseconds or coarser."""
        steps = np.diff(self.stamps_ns)
        return float(steps[steps <= GAP_FRAMES * np.median(steps)].mean())

    @property
    def duration_s(self) -> float:
        """From the first frame to the last one [s]."""
        return 1e-9 * float(self.stamps_ns[-1] - self.stamps_ns[0])

    def seconds(self, stamps_ns: NDArray[np.int64]) -> Array:
        """Stamps (N,) of its clock [ns] as times since its first frame [s]."""
        return np.asarray((stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)

    def scaled(self, metres: float) -> "CapturedMotion":
        """The same with lengths multiplied by the metres of their unit."""
        return replace(self, points={name: metres * points for name, points in self.points.items()}, has_unit=True)

    def smoothed(self, sigma_s: float) -> "CapturedMotion":
        """The same with points averaged by a Gaussian of so many seconds; NaN where frames under it are missing.

        A spline through noisy points is less noisy between frames than at them, which biases a clock that is fitted to
        it; a spline through averaged points is not.
        """
        size = sigma_s / (1e-9 * self.frame_ns)
        runs = np.split(
            np.arange(len(self.stamps_ns)), np.flatnonzero(np.diff(self.stamps_ns) > 1.5 * self.frame_ns) + 1
        )
        points = {name: np.full_like(raw, np.nan) for name, raw in self.points.items()}
        for name, raw in self.points.items():
            known: NDArray[np.bool_] = np.all(np.isfinite(raw), axis=1)
            for run in runs:
                weight, *axes = (
                    scipy.ndimage.gaussian_filter1d(np.where(known[run], values, 0.0), size, mode="constant")
                    for values in (np.ones(len(run)), *raw[run].T)
                )
                whole = weight > _WHOLE
                points[name][run[whole]] = np.stack(axes, axis=1)[whole] / weight[whole, None]
        return replace(self, points=points)

    def points_at(self, name: str, seconds: Array) -> Array:
        """A point (N, 3) [m] at times (N,) since the first frame [s], on a cubic spline; NaN where it is not known."""
        times, spline = self._curves[name]
        found = np.full((len(seconds), 3), np.nan)
        if spline is None:
            return found
        longest = max(_MAX_GAP_S, _MAX_GAP_FRAMES * 1e-9 * self.frame_ns)
        after = np.clip(np.searchsorted(times, seconds), 1, len(times) - 1)
        known = (seconds >= times[0]) & (seconds <= times[-1]) & (times[after] - times[after - 1] <= longest)
        found[known] = spline(seconds[known])
        return found

    def rotations_at(self, name: str, seconds: Array) -> Array:
        """A bone's rotation (N, 3, 3) at times (N,) since the first frame [s]; NaN before it and after the last one."""
        stamps_ns = np.rint(1e9 * seconds).astype(np.int64) + self.stamps_ns[0]
        inside = (stamps_ns >= self.stamps_ns[0]) & (stamps_ns <= self.stamps_ns[-1])
        found = np.full((len(seconds), 3, 3), np.nan)
        if inside.any():
            poses = rigid(self.rotations[name], np.zeros(3))
            found[inside] = interpolated(self.stamps_ns, poses, stamps_ns[inside])[:, :3, :3]
        return found

    @cached_property
    def _curves(self) -> "dict[str, tuple[Array, scipy.interpolate.CubicSpline | None]]":
        seconds = self.seconds(self.stamps_ns)
        curves: dict[str, tuple[Array, scipy.interpolate.CubicSpline | None]] = {}
        for name, points in self.points.items():
            seen = np.isfinite(points).all(axis=1)
            times = seconds[seen]
            curves[name] = times, scipy.interpolate.CubicSpline(times, points[seen]) if len(times) >= 2 else None
        return curves


def header_contradictions(captured: CapturedMotion, frames: str, rate: str) -> Iterator[str]:
    """What a header says of frames and their rate [1/s], as texts, that is not so, each with what is taken."""
    found = len(captured.stamps_ns)
    if frames.strip().isdecimal() and int(frames) != found:
        yield f"its header says {frames.strip()} frames, it has {found}; these are read"
    try:
        stated = float(rate)
    except ValueError:
        stated = math.nan
    timed = 1e9 / captured.frame_ns
    if stated > 0.0 and abs(timed / stated - 1.0) > _RATE_DIFFERS:
        yield f"its header says {stated:g} frames a second, its times {timed:.6g}; the times are taken"


def own_times(path: Path, times: Array | NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which rows (K,) of a file have another time than the row before; a warning counts those that do not.

    Simulations write their last state twice, and trackers a pose that they found anew.
    """
    own = np.ones(len(times), bool)
    own[1:] = times[1:] != times[:-1]
    if not own.all():
        logger.warning(
            "%s: %d of its %d rows have the time of the row before, the first of them row %d; they are left out",
            path,
            len(own) - int(own.sum()),
            len(own),
            int(np.argmin(own)) + 1,
        )
    return own


def checked_stamps(seconds: Array) -> NDArray[np.int64]:
    """Stamps (K,) [ns] of times (K,) [s].

    Raises:
        ValueError: there are fewer than two, they do not increase, or no clock has them.
    """
    if len(seconds) < 2 or not np.isfinite(seconds).all():
        raise ValueError("expected two frames or more, each with its time")
    if (latest := float(np.abs(seconds).max())) > _LATEST_S:
        raise ValueError(f"a time of {latest:g} s is none of a recording")
    stamps_ns = np.rint(1e9 * seconds).astype(np.int64)
    if not (np.diff(stamps_ns) > 0).all():
        frame = int(np.argmin(np.diff(stamps_ns) > 0)) + 2
        raise ValueError(f"frame {frame} is not later than the one before it")
    return stamps_ns
