"""Clock lags between two cameras of one segment by how they turned.

Cameras of one segment turn as it does: ``omega_first(t) = first_R_second omega_second(t - lag)`` with one rotation
between the mounts. Lag and rotation are fitted together, robustly, to all three components.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.ingest.angular_speed import AngularSpeed
from bodycam_ros.ingest.offset_search import Pair
from bodycam_ros.tracking.rotation import align_bearings

Array = NDArray[np.float64]

MIN_OVERLAP_S = 2.0
"""Shorter stretches of motion resemble each other by chance."""

DRIFT_SIGMA = 5e-5
"""Crystals of cameras are within 50 millionths of each other."""

_STRETCH_S, _MOST_STRETCHES = 30.0, 24  # drift within it is below 3 ms, and there are a dozen movements in it
_WINDOW_S = 0.1  # the search is right to some hundredths of a second
_STEP_S = 0.004  # of the search; a motion's spline is smooth over several of them
_ROUNDS = 8
_BLOCK_S = 0.25  # errors of samples closer than this go together: parallax of one swing
_SMOOTH = 0.7  # standard deviation of the smoothing, in intervals of the slower camera
_LEAST_SAMPLES = 20
_WIDEST_GAP = 2.5  # of a camera's interval; a spline over more invents motion
_LAG_FLOOR_S = 0.0005
_ENOUGH_TO_REJECT = 3  # stretches in which a pair did not turn as one body


@dataclass(frozen=True)
class PairLag:
    """Two cameras compared around one time.

    Attributes:
        first, second: names.
        first_s, second_s: media times of the middle of the comparison, which are the same time [s].
        sigma_s: standard deviation of their difference [s].
    """

    first: str
    second: str
    first_s: float
    second_s: float
    sigma_s: float


@dataclass(frozen=True)
class RigidLag:
    """A lag between two cameras of a segment.

    Attributes:
        lag_s: what must be added to the second camera's times [s].
        sigma_s: its standard deviation, from blocks of residuals [s].
        explained: share of the first camera's motion that the second one's explains, 1 for a rigid pair.
    """

    lag_s: float
    sigma_s: float
    explained: float


def rigid_lags(
    speeds: Mapping[str, AngularSpeed], starts: Mapping[str, float], pair: Pair, sure_s: float, least_explained: float
) -> list[PairLag]:
    """A pair compared in stretches of what both recorded; nothing where it does not turn as one body.

    Args:
        speeds: camera -> how it turned.
        starts: camera -> its start [s], to some hundredths.
        pair: the cameras.
        sure_s: time of the recording for which the starts are right [s]; away from it drift adds up.
        least_explained: share of the motion that a rigid pair must have in common.
    """
    first, second = (speeds[camera] for camera in pair)
    first_s, second_s = (starts[camera] + speeds[camera].media_s for camera in pair)
    middles, length = _stretches(first_s, second_s)
    lags: list[PairLag] = []
    for tried, middle in enumerate(sorted(middles, key=lambda middle: abs(middle - sure_s))):
        if tried == _ENOUGH_TO_REJECT and not lags:
            break
        window = _WINDOW_S + _largest_drift_s(middle - sure_s)
        ours = np.abs(first_s - middle) <= 0.5 * length
        theirs = np.abs(second_s - middle) <= 0.5 * length + window
        found = rigid_lag(first.part(ours), first_s[ours], second.part(theirs), second_s[theirs], window)
        if found is not None and found.explained >= least_explained:
            sigma = float(np.hypot(found.sigma_s, _LAG_FLOOR_S))
            lags.append(_pair_lag(starts, pair, middle, found.lag_s, sigma))
    return lags


def rigid_lag(
    first: AngularSpeed, first_s: Array, second: AngularSpeed, second_s: Array, window_s: float
) -> RigidLag | None:
    """The lag between two cameras within a window; None where too little is known, or the window's rim is best.

    Args:
        first, second: how they turned.
        first_s, second_s: (N,), (M,) their times on about the same clock [s].
        window_s: the largest lag [s].
    """
    if min(first.known.sum(), second.known.sum()) < _LEAST_SAMPLES:
        return None
    source_s, target_s = second_s[second.known], first_s[first.known]
    # Interpolated noise is smallest midway between samples, which draws the lag there; smooth noise is alike all over.
    smooth_s = _SMOOTH * max(_interval(source_s), _interval(target_s))
    source = gaussian_filter1d(second.omega[second.known], smooth_s / _interval(source_s), axis=0)
    target = gaussian_filter1d(first.omega[first.known], smooth_s / _interval(target_s), axis=0)
    curve = CubicSpline(source_s, source)
    slope = curve.derivative()
    inside = (target_s > source_s[0] + window_s) & (target_s < source_s[-1] - window_s)
    inside &= _is_dense(target_s, source_s, window_s)
    times, target = target_s[inside], target[inside]
    if len(times) < _LEAST_SAMPLES:
        return None
    weights = np.ones(len(times))
    lags = np.arange(-np.ceil(window_s / _STEP_S), np.ceil(window_s / _STEP_S) + 1) * _STEP_S

    def residuals(lag: float) -> tuple[Array, Array]:
        turned = curve(times - lag)
        first_R_second = align_bearings(turned * weights[:, None], target)
        return target - turned @ first_R_second.T, -slope(times - lag) @ first_R_second.T

    for _ in range(2):
        costs = [float((weights * (residuals(lag)[0] ** 2).sum(axis=1)).sum()) for lag in lags]
        lag = float(lags[int(np.argmin(costs))])
        weights = _cauchy_weights(residuals(lag)[0])
    for _ in range(_ROUNDS):
        errors, by_lag = residuals(lag)
        weights = _cauchy_weights(errors)
        gain = weights * (by_lag * errors).sum(axis=1)
        stiffness = float((weights * (by_lag**2).sum(axis=1)).sum())
        if stiffness <= 0.0:
            return None
        lag += float(np.clip(gain.sum() / stiffness, -_STEP_S, _STEP_S))
    if abs(lag) > window_s:
        return None
    blocks = np.floor((times - times[0]) / _BLOCK_S).astype(int)
    scatter = float((np.bincount(blocks, gain) ** 2).sum())
    explained = 1.0 - float((errors**2).sum()) / max(float((target**2).sum()), 1e-12)
    return RigidLag(lag, np.sqrt(scatter) / stiffness, explained)


def _is_dense(times: Array, others: Array, window_s: float) -> NDArray[np.bool_]:
    """Which times lie, at every lag of the window, between samples that are near each other."""
    after = np.clip(np.searchsorted(others, times + window_s), 1, len(others) - 1)
    before = np.clip(np.searchsorted(others, times - window_s) - 1, 0, len(others) - 2)
    wide = np.concatenate([[0], np.cumsum(np.diff(others) > _WIDEST_GAP * _interval(others))])
    return np.asarray(wide[after] == wide[before])


def _interval(times: Array) -> float:
    return float(np.median(np.diff(times)))


def _cauchy_weights(residuals: Array) -> Array:
    """Cauchy weights (N,) of residuals (N, 3), on a scale of their own."""
    sizes = np.linalg.norm(residuals, axis=1)
    scale = max(1.5 * float(np.median(sizes)), 1e-6)
    weights: Array = 1.0 / (1.0 + (sizes / scale) ** 2)
    return weights


def _stretches(first_s: Array, second_s: Array) -> tuple[list[float], float]:
    """Middles [s] of stretches of what two cameras both recorded, evenly spread, and their length [s]."""
    begin, end = max(first_s[0], second_s[0]), min(first_s[-1], second_s[-1])
    if end - begin < MIN_OVERLAP_S:
        return [], 0.0
    count = int(np.clip(round((end - begin) / _STRETCH_S), 1, _MOST_STRETCHES))
    middles = begin + (np.arange(count) + 0.5) * (end - begin) / count
    return middles.tolist(), float(min(_STRETCH_S, (end - begin) / count) if count > 1 else end - begin)


def _largest_drift_s(seconds: float) -> float:
    """By how much two clocks may have drifted apart over a time [s]."""
    return 3.0 * float(np.sqrt(2.0)) * DRIFT_SIGMA * abs(seconds)


def _pair_lag(starts: Mapping[str, float], pair: Pair, recording_s: float, lag_s: float, sigma_s: float) -> PairLag:
    first_s, second_s = (recording_s - starts[camera] for camera in pair)
    return PairLag(*pair, first_s, second_s - lag_s, sigma_s)
