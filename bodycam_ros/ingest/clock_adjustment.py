"""Start and drift of all cameras' clocks, adjusted together to what pairs of them say: robust least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.camera_time import CameraTime

Array = NDArray[np.float64]

_ROUNDS = 12
_FREE_S = 10.0  # [s] standard deviation of a start of which nothing is known; wider ones only cost digits


@dataclass(frozen=True)
class PairLag:
    """Two cameras compared around one instant: what the clocks that were believed leave between them.

    Attributes:
        first, second: names.
        first_s, second_s: media times of the middle of the comparison [s].
        lag_s: to be added to ``second``'s time less ``first``'s, as they were believed [s].
        sigma_s: standard deviation [s].
    """

    first: str
    second: str
    first_s: float
    second_s: float
    lag_s: float
    sigma_s: float


def adjust_clocks(
    reference: str, believed: Mapping[str, CameraTime], lags: Sequence[PairLag], source: str
) -> dict[str, CameraTime]:
    """Clocks that fit the lags between pairs and what was believed, each by its sigma; a wrong lag loses its weight.

    Args:
        reference: the camera whose clock is the recording's.
        believed: camera -> clock, with an infinite ``start_sigma_s`` where only the lags shall tell.
        lags: what pairs say.
        source: written into the result.
    """
    cameras = list(believed)
    column = {camera: 2 * index for index, camera in enumerate(cameras)}
    rows = np.zeros((len(lags), 2 * len(cameras)))
    for row, lag in zip(rows, lags, strict=True):
        row[[column[lag.second], column[lag.second] + 1]] += (1.0, lag.second_s)
        row[[column[lag.first], column[lag.first] + 1]] -= (1.0, lag.first_s)
    measured = np.array([lag.lag_s for lag in lags])
    sigmas = np.array([lag.sigma_s for lag in lags])
    prior = np.array([s for c in cameras for s in (believed[c].start_sigma_s, believed[c].drift_sigma)])
    prior = 1.0 / np.clip(prior, 1e-12, _FREE_S) ** 2
    weights = np.ones(len(lags))
    correction, covariance = np.zeros(len(prior)), np.diag(1.0 / prior)
    for _ in range(_ROUNDS):
        weighted = rows * (weights / sigmas**2)[:, None]
        covariance = np.linalg.inv(weighted.T @ rows + np.diag(prior))
        correction = covariance @ (weighted.T @ measured)
        weights = 1.0 / (1.0 + ((measured - rows @ correction) / (3.0 * sigmas)) ** 2)
    here = column[reference]
    against = np.eye(len(prior))
    for camera in cameras:
        against[column[camera], here] -= 1.0
        against[column[camera] + 1, here + 1] -= 1.0
    relative, spread = against @ correction, np.sqrt(np.maximum(np.diag(against @ covariance @ against.T), 0.0))
    clocks = {}
    for camera in cameras:
        start, drift = column[camera], column[camera] + 1
        was = believed[camera]
        clocks[camera] = CameraTime(
            camera,
            was.start_s - believed[reference].start_s + float(relative[start]),
            was.drift - believed[reference].drift + float(relative[drift]),
            float(spread[start]),
            float(spread[drift]),
            source if camera != reference else was.source,
        )
    return clocks
