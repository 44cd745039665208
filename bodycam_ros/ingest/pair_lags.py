"""What two cameras say of each other's clocks: one segment's in stretches, two segments' by their curve's summit.

Both turn as their segment does: ``omega_first(t) = first_R_second omega_second(t - lag)`` with one rotation between the
mounts. Lag and rotation are fitted together, robustly, to all three components.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.ingest.angular_speed import AngularSpeed
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.motion_correlation import SEARCH_RATE, even_motion, offset_curve
from bodycam_ros.ingest.offset_agreement import Pair, PairLag
from bodycam_ros.ingest.sound_settings import MotionSyncSettings
from bodycam_ros.tracking.rotation import align_bearings

Array = NDArray[np.float64]

_STEP_S = 0.004  # of the search; a motion's spline is smooth over several of them
_ROUNDS = 8
_BLOCK_S = 0.25  # errors of samples closer than this go together: parallax of one swing
_SMOOTH = 0.7  # standard deviation of the smoothing, in intervals of the slower camera
_LEAST_SAMPLES = 20
_WIDEST_GAP = 2.5  # of a camera's interval; a spline over more invents motion


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


def rigid_lag(
    first: AngularSpeed, first_s: Array, second: AngularSpeed, second_s: Array, window_s: float
) -> RigidLag | None:
    """The lag between two cameras within a window; None where too little is seen by both, or the window's rim is best.

    Args:
        first, second: how they turned.
        first_s, second_s: (N,), (M,) their times on what is believed to be one clock [s].
        window_s: the largest lag [s].
    """
    if second.known.sum() < _LEAST_SAMPLES or first.known.sum() < _LEAST_SAMPLES:
        return None
    source_s, target_s = second_s[second.known], first_s[first.known]
    # Interpolated noise is smallest midway between samples, which draws the lag there; smooth noise is alike all over.
    smooth_s = _SMOOTH * max(_interval(source_s), _interval(target_s))
    source = gaussian_filter1d(second.omega[second.known], smooth_s / _interval(source_s), axis=0)
    smoothed = np.full_like(first.omega, np.nan)
    smoothed[first.known] = gaussian_filter1d(first.omega[first.known], smooth_s / _interval(target_s), axis=0)
    curve = CubicSpline(source_s, source)
    slope = curve.derivative()
    inside = first.known & (first_s > source_s[0] + window_s) & (first_s < source_s[-1] - window_s)
    inside &= _close(first_s, source_s, window_s)
    times, target = first_s[inside], smoothed[inside]
    if len(times) < _LEAST_SAMPLES:
        return None
    weights = np.ones(len(times))
    lags = np.arange(-np.ceil(window_s / _STEP_S), np.ceil(window_s / _STEP_S) + 1) * _STEP_S
    for _ in range(2):
        costs = [_cost(target, curve(times - lag), weights) for lag in lags]
        lag = float(lags[int(np.argmin(costs))])
        weights = _weights(target - curve(times - lag) @ _rotation(target, curve(times - lag), weights).T)
    for _ in range(_ROUNDS):
        turned = _rotation(target, curve(times - lag), weights)
        residuals = target - curve(times - lag) @ turned.T
        weights = _weights(residuals)
        by_lag = -slope(times - lag) @ turned.T
        gain = weights * (by_lag * residuals).sum(axis=1)
        stiffness = float((weights * (by_lag**2).sum(axis=1)).sum())
        if stiffness <= 0.0:
            return None
        lag += float(np.clip(gain.sum() / stiffness, -_STEP_S, _STEP_S))
    if abs(lag) > window_s:
        return None
    blocks = np.floor((times - times[0]) / _BLOCK_S).astype(int)
    scatter = float((np.bincount(blocks, gain) ** 2).sum())
    power = float((target**2).sum())
    left = float((residuals**2).sum())
    return RigidLag(lag, np.sqrt(scatter) / stiffness, 1.0 - left / max(power, 1e-12))


def _close(times: Array, others: Array, window_s: float) -> NDArray[np.bool_]:
    """Which times lie, at every lag of the window, between samples that are near each other."""
    after = np.clip(np.searchsorted(others, times + window_s), 1, len(others) - 1)
    before = np.clip(np.searchsorted(others, times - window_s) - 1, 0, len(others) - 2)
    wide = np.concatenate([[0], np.cumsum(np.diff(others) > _WIDEST_GAP * _interval(others))])
    return np.asarray(wide[after] == wide[before])


def _interval(times: Array) -> float:
    return float(np.median(np.diff(times)))


def _rotation(target: Array, source: Array, weights: Array) -> Array:
    return align_bearings(source * weights[:, None], target)


def _cost(target: Array, source: Array, weights: Array) -> float:
    residuals = target - source @ _rotation(target, source, weights).T
    return float((weights * (residuals**2).sum(axis=1)).sum())


def _weights(residuals: Array) -> Array:
    """Cauchy weights (N,) of residuals (N, 3), on a scale of their own."""
    sizes = np.linalg.norm(residuals, axis=1)
    scale = max(1.5 * float(np.median(sizes)), 1e-6)
    weights: Array = 1.0 / (1.0 + (sizes / scale) ** 2)
    return weights


_SUMMIT_S = 0.25  # around the agreed offset in which a pair's own summit is looked for
_LINKED_FLOOR_S = 0.02  # a limb leads or trails its neighbour by hundredths of a second
_LAG_FLOOR_S = 0.0005
_MOST_CHUNKS = 24
_ENOUGH_TO_REFUSE = 3  # stretches in which a pair did not turn as one body
_MOST_STRETCHES = 8
_BESIDE_S = 5.0  # of lags beside those in question, which tell what chance gives


def rigid_lags(
    speeds: Mapping[str, AngularSpeed],
    believed: Mapping[str, CameraTime],
    pair: Pair,
    window_s: float,
    sure_at_s: float,
    least_explained: float,
    settings: MotionSyncSettings,
) -> list[PairLag]:
    """A pair compared in stretches all over what both recorded; nothing where it does not turn as one body.

    Args:
        speeds: camera -> how it turned.
        believed: camera -> its clock.
        pair: the cameras.
        window_s: how far the clocks may be apart [s].
        sure_at_s: time of the recording for which that is so; away from it drift adds to it [s].
        least_explained: share of the motion that a rigid pair must have in common.
        settings: lengths.
    """
    first, second = (speeds[camera] for camera in pair)
    first_s, second_s = (believed[c].recording_s(speeds[c].media_s) for c in pair)
    middles, length = _stretches(first_s, second_s, settings.chunk, _MOST_CHUNKS, settings)
    lags: list[PairLag] = []
    for tried, middle in enumerate(sorted(middles, key=lambda middle: abs(middle - sure_at_s))):
        if tried == _ENOUGH_TO_REFUSE and not lags:
            break
        window = window_s + _drifted(believed, pair, middle - sure_at_s)
        ours = np.abs(first_s - middle) <= 0.5 * length
        theirs = np.abs(second_s - middle) <= 0.5 * length + window
        found = rigid_lag(first.part(ours), first_s[ours], second.part(theirs), second_s[theirs], window)
        if found is None or found.explained < least_explained:
            continue
        sigma = float(np.hypot(found.sigma_s, _LAG_FLOOR_S))
        lags.append(_pair_lag(believed, pair, middle, found.lag_s, sigma))
    return lags


def linked_lags(
    speeds: Mapping[str, AngularSpeed],
    believed: Mapping[str, CameraTime],
    pair: Pair,
    sure_at_s: float,
    settings: MotionSyncSettings,
) -> list[PairLag]:
    """Two segments' cameras compared in long stretches, where their motions go together best.

    Args:
        speeds: camera -> how it turned.
        believed: camera -> its clock, without drift.
        pair: the cameras.
        sure_at_s: time of the recording for which the clocks are right [s]; away from it drift adds up.
        settings: lengths.
    """
    clocks = [believed[camera] for camera in pair]
    first_s, second_s = (clock.recording_s(speeds[clock.camera].media_s) for clock in clocks)
    middles, length = _stretches(first_s, second_s, settings.searched, _MOST_STRETCHES, settings)
    lags = []
    for middle in middles:
        reach_s = _SUMMIT_S + _drifted(believed, pair, middle - sure_at_s)
        around = (middle - 0.5 * length, middle + 0.5 * length)
        motions = [even_motion(speeds[c.camera], around[0] - c.start_s, around[1] - c.start_s) for c in clocks]
        if motions[0] is None or motions[1] is None:
            continue
        # Moved to one clock, so that lags are looked at and not starts.
        first, second = (
            replace(motion, first=motion.first + round(clock.start_s * SEARCH_RATE))
            for motion, clock in zip(motions, clocks, strict=True)
            if motion is not None
        )
        curve = offset_curve(first, second, settings.min_overlap, reach_s + _BESIDE_S)
        if curve is None:
            continue
        lag, sigma = curve.summit(0, round(reach_s * SEARCH_RATE))
        lags.append(_pair_lag(believed, pair, middle, lag / SEARCH_RATE, max(sigma / SEARCH_RATE, _LINKED_FLOOR_S)))
    return lags


def _stretches(
    first_s: Array, second_s: Array, length_s: float, most: int, settings: MotionSyncSettings
) -> tuple[list[float], float]:
    """Middles [s] of stretches of what two cameras both recorded, evenly spread, and their length [s]."""
    begin, end = max(first_s[0], second_s[0]), min(first_s[-1], second_s[-1])
    if end - begin < settings.min_overlap:
        return [], 0.0
    count = int(np.clip(round((end - begin) / length_s), 1, most))
    middles = begin + (np.arange(count) + 0.5) * (end - begin) / count
    return middles.tolist(), float(min(length_s, (end - begin) / count) if count > 1 else end - begin)


def _drifted(believed: Mapping[str, CameraTime], pair: Pair, seconds: float) -> float:
    """By how much two clocks may have drifted apart over a time [s]."""
    return 3.0 * float(np.hypot(believed[pair[0]].drift_sigma, believed[pair[1]].drift_sigma)) * abs(seconds)


def _pair_lag(
    believed: Mapping[str, CameraTime], pair: Pair, recording_s: float, lag_s: float, sigma_s: float
) -> PairLag:
    first_s, second_s = ((recording_s - believed[camera].start_s) / (1.0 + believed[camera].drift) for camera in pair)
    return PairLag(pair[0], pair[1], first_s, second_s, lag_s, sigma_s)
