"""Clocks of cameras, fitted to events that several of them recorded: a sound, or the same movement.

A camera c that records the event e at its media time a has ``start_c + (1 + drift_c) a = t_e``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]

_DRIFT_SIGMA = 100e-6  # of two cameras: crystals are sold with 20 to 50 ppm, and get warm; a minute outweighs it
_ROUNDS = 30
_CAUCHY = 2.4  # sigmas: 95 % efficient where nothing is wrong


@dataclass(frozen=True)
class CameraTime:
    """A camera's clock: ``recording_s = start_s + (1 + drift) * media_s``.

    The reference camera has ``start_s = 0``, ``drift = 0`` and no uncertainty.

    Attributes:
        camera: its name.
        start_s: the time of the recording at the media time 0 [s].
        drift: seconds by which the recording's time gains on the media time, per second.
        start_sigma_s: standard deviation of ``start_s`` [s].
        drift_sigma: standard deviation of ``drift``.
        source: what it was found by: sound, motion or given.
        confidence: 0 to 1, how far ahead its start is of the second best; 1 of a given one.
    """

    camera: str
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


def fit_clocks(
    cameras: Sequence[str],
    events: Sequence[Sequence[tuple[int, float, float]]],
    reference: str,
    source: str,
    floor_s: float = 0.0,
) -> dict[str, CameraTime]:
    """Fit all clocks to the time of the reference camera by robust least squares; the events' times are eliminated.

    Cameras that share no event with the reference, if only through others, are left out.

    Args:
        cameras: names (C,), as the events count them.
        events: those that cameras have in common: (camera's number, media time [s], its standard deviation [s]) of
            each record of an event.
        reference: the camera that has start 0 and drift 0.
        source: written into the clocks.
        floor_s: standard deviation that all events of a camera have in common [s].
    """
    count, zero = len(cameras), list(cameras).index(reference)
    records = np.array([(number, *record) for number, of_event in enumerate(events) for record in of_event], np.float64)
    event, camera = records.reshape(-1, 4)[:, :2].astype(np.int64).T
    joined = _joined(event, camera, count, zero)
    used = joined[camera]
    event, camera, (media_s, sigma_s) = event[used], camera[used], records.reshape(-1, 4)[used, 2:].T
    number = len(events)
    rows = np.arange(len(event))
    design = np.zeros((len(event), 2 * count))
    design[rows, camera] = 1.0
    design[rows, count + camera] = media_s
    free = np.tile(joined & (np.arange(count) != zero), 2)
    prior = np.diag(np.repeat([0.0, _DRIFT_SIGMA**-2.0], count)[free])

    def centred(values: Array, weight: Array) -> Array:
        """Less the weighted mean of the event, by which its time is eliminated."""
        sums = np.zeros((number, *values.shape[1:]))
        np.add.at(sums, event, (values.T * weight).T)
        total = np.bincount(event, weight, number)[event]
        result: Array = values - (sums[event].T / total).T
        return result

    base = sigma_s**-2.0
    weight, solution, covariance = base, np.zeros(2 * count), np.zeros((2 * count, 2 * count))
    for _ in range(_ROUNDS):
        reduced, wanted = centred(design[:, free], weight), -centred(media_s, weight)
        spread = np.linalg.pinv((reduced.T * weight) @ reduced + prior, hermitian=True)
        solution[free] = spread @ ((reduced.T * weight) @ wanted)
        covariance[np.ix_(free, free)] = spread
        residuals = centred(design @ solution + media_s, weight)
        weight = base / (1.0 + residuals**2 * base / _CAUCHY**2)
    sigma = np.sqrt(np.diag(covariance))
    return {
        name: CameraTime(
            name,
            float(solution[k]),
            float(solution[count + k]),
            float(np.hypot(sigma[k], floor_s)) if k != zero else 0.0,
            float(sigma[count + k]),
            source,
        )
        for k, name in enumerate(cameras)
        if joined[k]
    }


def _joined(event: NDArray[np.int64], camera: NDArray[np.int64], cameras: int, reference: int) -> NDArray[np.bool_]:
    """Which cameras (C,) share events with the reference, if only through others."""
    size = cameras + int(event.max(initial=-1)) + 1
    links = coo_array((np.ones(len(event)), (camera, cameras + event)), (size, size))
    label = connected_components(links, directed=False)[1]
    joined: NDArray[np.bool_] = label[:cameras] == label[reference]
    return joined


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
    return moved | {reference: CameraTime(reference, source=zero.source, confidence=zero.confidence)}


@dataclass(frozen=True, eq=False)
class FoundTimes:
    """Clocks by one source, such as motion.

    Attributes:
        source: sound, motion or given.
        times: camera -> its clock, in the time of those known before, or in one of its own.
        remarks: for the user, a sentence each.
    """

    source: str
    times: Mapping[str, CameraTime]
    remarks: Sequence[str] = ()


TimeSource = Callable[[Mapping[str, CameraTime]], FoundTimes]
"""Clocks by one source; the clocks already known are given."""
