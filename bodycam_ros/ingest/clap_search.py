"""Which peaks of two sets are the same sounds: the most consistent spacing, by exhaustive search (A section 3)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MOST_DRIFTS = 2001
_APART_S = 0.05  # two hypotheses nearer than this are one
_UNHEARD = 0.3  # of a sound's weight, off where several heard it and a camera that ran did not
_ALONE = 0.05  # of the weight of a sound that one camera alone heard: straps and hands knock on cameras
_BY_TIME_ALONE = 0.3  # worth of a match of waveforms that have nothing in common
_BY_ENDS = 0.5  # of a clap: cameras are started one after the other, and stopped so
_NEAR_ENDS_S = 3.0
_COUNTS_FROM = 0.25  # weight from which a sound is loud enough that it would be missed


@dataclass(frozen=True, eq=False)
class WeightedTimes:
    """Sounds, in order of time.

    Attributes:
        times: (N,) [s].
        weights: (N,) how much each is worth, 0 to 1.
        spans: (M, 2) times between which somebody listened [s].
        shared: (N,) whether several heard it.
    """

    times: Array
    weights: Array
    spans: Array
    shared: NDArray[np.bool_]

    def listened(self, times: Array, margin: float) -> NDArray[np.bool_]:
        """Whether anybody listened at the times (N,) [s], ``margin`` [s] within the ends."""
        inside = (times[:, None] > self.spans[:, 0] + margin) & (times[:, None] < self.spans[:, 1] - margin)
        result: NDArray[np.bool_] = np.any(inside, axis=1)
        return result


@dataclass(frozen=True, eq=False)
class Spacing:
    """A way to lay a second set of sounds upon a first: ``first = shift + (1 + drift) * second``.

    Attributes:
        shift: [s].
        drift: seconds per second.
        score: weight of the sounds that meet, less that of those that should and do not.
        firsts: (K,) sounds of the first set that meet one.
        seconds: (K,) the sounds of the second that they meet.
        alike: how alike the waveforms of those are that are most alike, 0 to 1.
        together: up to 0.5, more if somebody of both began or ended at the same time.
    """

    shift: float
    drift: float
    score: float
    firsts: NDArray[np.int64]
    seconds: NDArray[np.int64]
    alike: float
    together: float

    @property
    def rank(self) -> float:
        """The greater, the likelier; of one clap, which may be the first or the last, ``together`` decides."""
        return self.score + self.together


Alike = Callable[[int, int], float]
"""How alike the waveforms of a first and a second sound are, 0 to 1."""


def spacings(
    first: WeightedTimes,
    second: WeightedTimes,
    tolerance: float,
    largest_drift: float,
    alike: Alike,
    most: int = 12,
) -> list[Spacing]:
    """The most consistent spacings, best first.

    Every difference between a time of the first and one of the second votes, once for every drift that can be told from
    another; of the fullest clusters each is then looked at closely.

    Args:
        first: of which the time is kept.
        second: that is moved.
        tolerance: within which two sounds are the same [s].
        largest_drift: between the two clocks.
        alike: weighs a match by the waveforms.
        most: spacings to return.
    """
    if not len(first.times) or not len(second.times):
        return []
    middle = 0.5 * (second.times[0] + second.times[-1])
    differences = first.times[:, None] - second.times[None, :]
    worth = np.minimum(first.weights[:, None], second.weights[None, :]).ravel()
    span = float(second.times[-1] - second.times[0])
    count = min(_MOST_DRIFTS, 1 + 2 * int(np.ceil(largest_drift * span / tolerance)))
    drifts = np.linspace(-largest_drift, largest_drift, count) if count > 1 else np.zeros(1)

    found: list[tuple[float, float, float]] = []
    for drift in drifts:
        at = (differences - drift * (second.times - middle)).ravel()
        order = np.argsort(at)
        at = at[order]
        sums = np.concatenate((np.zeros(1), np.cumsum(worth[order])))
        votes = sums[np.searchsorted(at, at + 2.0 * tolerance, side="right")] - sums[:-1]
        for cell in np.argpartition(votes, -min(most, len(votes)))[-most:]:
            found.append((float(votes[cell]), float(at[cell]) + tolerance, float(drift)))
    found.sort(reverse=True)

    results: list[Spacing] = []
    seen: list[float] = []
    for _, shift, drift in found:
        if any(abs(shift - other) < _APART_S for other in seen):
            continue
        seen.append(shift)
        results.append(_looked_at(first, second, (shift, drift, middle), tolerance, alike))
        if len(results) == most:
            break
    return sorted(results, key=lambda spacing: -spacing.rank)


def _looked_at(
    first: WeightedTimes,
    second: WeightedTimes,
    cluster: tuple[float, float, float],
    tolerance: float,
    alike: Alike,
) -> Spacing:
    """The spacing of a cluster (shift at the middle time, drift, middle time), and what it is worth."""
    shift, drift, middle = cluster
    moved = second.times + shift + drift * (second.times - middle)
    firsts, seconds = _meetings(first.times, moved, 1.5 * tolerance)
    if len(firsts):
        worth = np.minimum(first.weights[firsts], second.weights[seconds])
        shift += float(np.average(first.times[firsts] - moved[seconds], weights=worth + 1e-9))
        moved = second.times + shift + drift * (second.times - middle)
        firsts, seconds = _meetings(first.times, moved, tolerance)
    worth = np.minimum(first.weights[firsts], second.weights[seconds])
    likes = np.array([alike(int(a), int(b)) for a, b in zip(firsts, seconds, strict=True)])
    worth = worth * (_BY_TIME_ALONE + (1.0 - _BY_TIME_ALONE) * likes)
    span = second.spans + shift + drift * (second.spans - middle)
    there = WeightedTimes(moved, second.weights, span, second.shared)
    missed = _missed(first, firsts, there, tolerance) + _missed(there, seconds, first, tolerance)
    return Spacing(
        shift - drift * middle,
        drift,
        float(worth.sum()) - missed,
        firsts,
        seconds,
        float(likes.max(initial=0.0)),
        _together(first.spans, span),
    )


def _together(first: Array, second: Array) -> float:
    gaps = np.abs(first[:, None, :] - second[None, :, :])
    return _BY_ENDS * float(np.exp(-gaps.min() / _NEAR_ENDS_S))


def _meetings(first: Array, moved: Array, tolerance: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of times (K,), (K,) within the tolerance, each the other's nearest."""
    gaps = np.abs(first[:, None] - moved[None, :])
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(first))
    mutual = (gaps.argmin(axis=0)[nearest] == rows) & (gaps[rows, nearest] <= tolerance)
    return rows[mutual], nearest[mutual]


def _missed(own: WeightedTimes, heard: NDArray[np.int64], other: WeightedTimes, tolerance: float) -> float:
    """What the loud sounds cost that the other side should have heard and did not."""
    silent = own.weights >= _COUNTS_FROM
    silent[heard] = False
    silent &= other.listened(own.times, 10.0 * tolerance)
    return float((own.weights * np.where(own.shared, _UNHEARD, _ALONE))[silent].sum())
