"""Clocks of cameras, and their fit to what pairs of them recorded.

Cameras c and d that record the same at media times a and b have
``start_c + (1 + drift_c) a = start_d + (1 + drift_d) b``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.robust_least_squares import robust_least_squares

_DRIFT_SIGMA = 100e-6  # of two cameras: crystals are sold with 20 to 50 ppm, and get warm; a minute outweighs it
_ROUNDS = 30
_CAUCHY = 3.4  # sigmas of the difference of two times: 95 % efficient where nothing is wrong


@dataclass(frozen=True)
class CameraTime:
    """A camera's clock: ``recording_s = start_s + (1 + drift) * media_s``.

    The reference camera has ``start_s = 0``, ``drift = 0`` and no uncertainty.

    Attributes:
        start_s: the time of the recording at the media time 0 [s].
        drift: seconds by which the recording's time gains on the media time, per second.
        start_sigma_s: standard deviation of ``start_s`` [s].
        drift_sigma: standard deviation of ``drift``.
        source: what it was found by: sound, motion or given.
        confidence: 0 to 1, how far ahead its start is of the second best; 1 of a given one.
    """

    start_s: float = 0.0
    drift: float = 0.0
    start_sigma_s: float = 0.0
    drift_sigma: float = 0.0
    source: str = "given"
    confidence: float = 1.0

    def recording_s(self, media_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times of the recording (N,) [s] at media times (N,) [s]."""
        times: NDArray[np.float64] = self.start_s + (1.0 + self.drift) * media_s
        return times


Reading = tuple[tuple[str, str], tuple[float, float]]
"""Two cameras, and their media times [s] of something that both recorded."""


def fit_clocks(
    readings: Sequence[Reading], reference: str, sigma_s: float, floor_s: float = 0.0
) -> dict[str, CameraTime]:
    """Fit all clocks to the time of the reference camera by robust least squares.

    Cameras that have nothing in common with the reference, if only through others, are left out.

    Args:
        readings: what pairs of cameras recorded.
        reference: the camera that has start 0 and drift 0.
        sigma_s: standard deviation of the difference of the two times of a reading [s].
        floor_s: that all readings of a camera have in common [s].
    """
    joined = {reference}
    while more := {name for pair, _ in readings if not joined.isdisjoint(pair) for name in pair} - joined:
        joined |= more
    used = [reading for reading in readings if reading[0][0] in joined]
    column = {name: number for number, name in enumerate(sorted(joined - {reference}))}
    count = len(column)
    design, wanted = np.zeros((len(used), 2 * count)), np.zeros(len(used))
    for row, (pair, times) in enumerate(used):
        wanted[row] = (times[0] - times[1]) / sigma_s
        for name, media_s, sign in zip(pair, times, (-1.0, 1.0), strict=True):
            if name != reference:
                design[row, [column[name], count + column[name]]] = sign / sigma_s, sign * media_s / sigma_s
    prior = np.repeat([np.inf, _DRIFT_SIGMA], count)

    def linearise(clocks: Array) -> tuple[Array, Array]:
        return (design @ clocks - wanted)[:, None], design[:, None]

    start = robust_least_squares(linearise, np.zeros(2 * count), prior, kernel=np.inf, rounds=1)
    fit = robust_least_squares(linearise, start.values, prior, _CAUCHY, _ROUNDS - 1)
    clocks, sigma = fit.values, np.sqrt(np.diag(fit.covariance))
    fitted = {reference: CameraTime()}
    for name, k in column.items():
        start_s, drift = float(clocks[k]), float(clocks[count + k])
        fitted[name] = CameraTime(start_s, drift, float(np.hypot(sigma[k], floor_s)), float(sigma[count + k]))
    return fitted


def relative_to(reference: str, times: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """The same clocks in the time of another camera; the uncertainty of the others grows by the reference's own."""
    zero = times[reference]
    moved = {
        name: replace(
            time,
            start_s=(time.start_s - zero.start_s) / (1.0 + zero.drift),
            drift=(1.0 + time.drift) / (1.0 + zero.drift) - 1.0,
            start_sigma_s=float(np.hypot(time.start_sigma_s, zero.start_sigma_s)),
            drift_sigma=float(np.hypot(time.drift_sigma, zero.drift_sigma)),
        )
        for name, time in times.items()
    }
    return moved | {reference: CameraTime(source=zero.source, confidence=zero.confidence)}
