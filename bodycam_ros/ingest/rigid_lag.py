"""How far one camera's clock is off another's on the same segment, to a fraction of a frame.

Both turn as their segment does: ``omega_first(t) = first_R_second omega_second(t - lag)`` with one rotation between the
mounts. Lag and rotation are fitted together, robustly, to all three components.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.ingest.angular_speed import AngularSpeed
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
