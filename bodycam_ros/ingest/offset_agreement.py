"""The offsets on which all pairs of cameras agree: one pair alone may be a step of a walk off, a circle may not.

A camera c that hears the sound e at its media time a has ``start_c + (1 + drift_c) a = t_e + travel``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.motion_correlation import OffsetCurve
from bodycam_ros.ingest.sound_settings import ClockSettings

Pair = tuple[str, str]
Whole = NDArray[np.int64]

_ROUNDS = 30
_STARTS = 8
"""Spanning trees to begin with: of the surest pairs first, then of pairs drawn by lot among the sure ones."""


@dataclass(frozen=True)
class AgreedOffset:
    """Where one camera starts.

    Attributes:
        samples: its offset against the reference.
        confidence: 0 to 1, how far its evidence stands above the next best offset's and above chance.
    """

    samples: int
    confidence: float


def agreed_offsets(
    reference: str, curves: Mapping[Pair, OffsetCurve], chance: Mapping[Pair, OffsetCurve], apart: int
) -> dict[str, AgreedOffset]:
    """Offsets that maximise the evidence of all pairs together, for the cameras that pairs link to the reference.

    From a spanning tree on, the cameras on one side of an edge are moved against the others to wherever all pairs
    across have most evidence, and each camera on its own, until nothing gains.

    Args:
        reference: the camera whose offset is 0.
        curves: (first, second) -> evidence for ``offset_second - offset_first``.
        chance: (first, second) -> evidence with the second's time reversed, for ``-offset_second - offset_first``: what
            two such motions have in common by chance.
        apart: offsets that differ by less are the same answer [samples].
    """
    best: dict[str, int] = {}
    best_parts: list[frozenset[str]] = []
    most = -np.inf
    for start in range(_STARTS):
        tree = _spanning_tree(reference, curves, np.random.default_rng(start) if start else None)
        offsets = _along(reference, tree, curves)
        parts = _parts(reference, tree)
        for _ in range(_ROUNDS):
            if not any([_move(part, offsets, curves) for part in parts]):
                break
        evidence = _evidence(offsets, curves)
        if evidence > most:
            best, best_parts, most = offsets, parts, evidence
    confidence = dict.fromkeys(best, 1.0)
    for part in best_parts:
        clear = _clear(part, best, curves, chance, apart)
        for camera in part:
            confidence[camera] = min(confidence[camera], clear)
    return {camera: AgreedOffset(samples, confidence[camera]) for camera, samples in best.items()}


def _spanning_tree(reference: str, curves: Mapping[Pair, OffsetCurve], lot: np.random.Generator | None) -> list[Pair]:
    """Edges of a tree from the reference to all that it reaches, (known, new), the surest first (Prim 1957)."""
    sure = {pair: float(curve.values.max()) for pair, curve in curves.items()}
    if lot is not None:
        sure = {pair: value * lot.uniform(0.2, 1.0) for pair, value in sure.items()}
    reached, tree = {reference}, []
    while across := [pair for pair in curves if (pair[0] in reached) != (pair[1] in reached)]:
        first, second = max(across, key=lambda pair: sure[pair])
        edge = (first, second) if first in reached else (second, first)
        tree.append(edge)
        reached.add(edge[1])
    return tree


def _along(reference: str, tree: Sequence[Pair], curves: Mapping[Pair, OffsetCurve]) -> dict[str, int]:
    offsets = {reference: 0}
    for known, new in tree:
        step = curves[known, new].best if (known, new) in curves else -curves[new, known].best
        offsets[new] = offsets[known] + step
    return offsets


def _parts(reference: str, tree: Sequence[Pair]) -> list[frozenset[str]]:
    """What may be moved as one: what hangs on each edge, and each camera alone."""
    parts = [frozenset([new]) for _, new in tree]
    for _, new in tree:
        hanging = {new}
        for known, newer in tree:
            if known in hanging:
                hanging.add(newer)
        parts.append(frozenset(hanging))
    # The reference stays; moving it alone is moving all others.
    parts.append(frozenset(new for _, new in tree))
    return list(dict.fromkeys(part for part in parts if part))


def _crossing(part: frozenset[str], offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]) -> list[Pair]:
    return [pair for pair in curves if (pair[0] in part) != (pair[1] in part) and pair[0] in offsets]


def _across(
    part: frozenset[str], offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]
) -> tuple[Whole, NDArray[np.float64]]:
    """Shifts of a part against the rest, and the evidence of all pairs across for each."""
    crossing = _crossing(part, offsets, curves)
    reach = [_shifts_of(pair, part, offsets, curves[pair]) for pair in crossing]
    shifts = np.arange(min(low for low, _ in reach), max(high for _, high in reach) + 1)
    evidence = np.zeros(len(shifts))
    for first, second in crossing:
        sign = 1 if second in part else -1
        evidence += curves[first, second].at(offsets[second] - offsets[first] + sign * shifts)
    return shifts, evidence


def _shifts_of(pair: Pair, part: frozenset[str], offsets: Mapping[str, int], curve: OffsetCurve) -> tuple[int, int]:
    now = offsets[pair[1]] - offsets[pair[0]]
    low, high = curve.lowest - now, curve.lowest + len(curve.values) - 1 - now
    return (low, high) if pair[1] in part else (-high, -low)


def _move(part: frozenset[str], offsets: dict[str, int], curves: Mapping[Pair, OffsetCurve]) -> bool:
    """Move a part to where the pairs across have most evidence; whether it moved."""
    shifts, evidence = _across(part, offsets, curves)
    shift = int(shifts[np.argmax(evidence)])
    if shift == 0:
        return False
    for camera in part:
        offsets[camera] += shift
    return True


def _clear(
    part: frozenset[str],
    offsets: Mapping[str, int],
    curves: Mapping[Pair, OffsetCurve],
    chance: Mapping[Pair, OffsetCurve],
    apart: int,
) -> float:
    """How far the evidence for a part's place stands above that for any other and above chance, as a share of it."""
    shifts, evidence = _across(part, offsets, curves)
    here = float(evidence[np.abs(shifts) < apart].max())
    elsewhere = float(evidence[np.abs(shifts) >= apart].max(initial=0.0))
    return max(0.0, 1.0 - max(elsewhere, _by_chance(part, offsets, chance)) / here) if here > 0.0 else 0.0


def _by_chance(part: frozenset[str], offsets: Mapping[str, int], chance: Mapping[Pair, OffsetCurve]) -> float:
    """The most evidence that a part has with the rest at any shift if its time runs backwards."""
    # Reversing the first of a pair is reversing the second and the shift, so one formula serves both.
    curves = {pair: chance[pair] for pair in _crossing(part, offsets, chance)}
    places = {(first, second): offsets[first] + offsets[second] for first, second in curves}
    low = min(curve.lowest + places[pair] for pair, curve in curves.items())
    high = max(curve.lowest + len(curve.values) + places[pair] for pair, curve in curves.items())
    shifts = np.arange(low, high)
    evidence = np.zeros(len(shifts))
    for pair, curve in curves.items():
        evidence += curve.at(shifts - places[pair])
    return float(evidence.max())


def _evidence(offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]) -> float:
    return sum(
        float(curve.at(np.array([offsets[second] - offsets[first]]))[0])
        for (first, second), curve in curves.items()
        if first in offsets
    )


Array = NDArray[np.float64]

SOUND_SPEED = 343.0
"""Of air at 20 degrees [m/s]; at -10 degrees 325."""

_CAUCHY = 2.4  # sigmas: the usual constant, 95 % efficient where nothing is wrong


@dataclass(frozen=True, eq=False)
class HeardSounds:
    """N times that one of E sounds was heard by one of C cameras.

    Attributes:
        sound: (N,) number of the sound.
        camera: (N,) number of the camera.
        media_s: (N,) media time [s].
        sigma_s: (N,) standard deviation of it without the travel [s].
    """

    sound: NDArray[np.int64]
    camera: NDArray[np.int64]
    media_s: Array
    sigma_s: Array


@dataclass(frozen=True, eq=False)
class Clocks:
    """What the fit says of C cameras and E sounds.

    Attributes:
        starts: (C,) [s].
        drifts: (C,).
        start_sigmas: (C,) [s], the travel from sounds to cameras and to the reference included.
        drift_sigmas: (C,).
        sounds_s: (E,) times of the recording [s].
        residuals_s: (N,) by how much each was heard later than the fit says [s].
    """

    starts: Array
    drifts: Array
    start_sigmas: Array
    drift_sigmas: Array
    sounds_s: Array
    residuals_s: Array


def fit_clocks(heard: HeardSounds, reference: int, first_starts: Array, settings: ClockSettings) -> Clocks:
    """Fit all clocks to the time of the reference camera.

    Args:
        heard: connected: every camera shares sounds with the reference, if only through others.
        reference: number of the camera that has start 0 and drift 0.
        first_starts: (C,) where cameras start, to some milliseconds [s].
        settings: of the error budget.
    """
    cameras, sounds = len(first_starts), int(heard.sound.max()) + 1
    first_starts = first_starts - first_starts[reference]
    times = first_starts[heard.camera] + heard.media_s
    about = np.bincount(heard.sound, times, sounds) / np.maximum(np.bincount(heard.sound, minlength=sounds), 1)
    crowd = np.array([(np.abs(about - at) <= settings.same_posture).sum() for at in about])
    moved_s = settings.moved_sigma / SOUND_SPEED
    sigma = np.sqrt(heard.sigma_s**2 + moved_s**2 * crowd[heard.sound])

    rows = np.arange(len(sigma))
    design = np.zeros((len(sigma), 2 * cameras + sounds))
    design[rows, heard.camera] = 1.0
    design[rows, cameras + heard.camera] = heard.media_s
    design[rows, 2 * cameras + heard.sound] = -1.0
    prior = np.zeros(2 * cameras + sounds)
    prior[cameras : 2 * cameras] = settings.drift_sigma**-2.0
    free = np.ones(len(prior), dtype=bool)
    free[[reference, cameras + reference]] = False
    offset = -heard.media_s - first_starts[heard.camera] + about[heard.sound]

    # Of what is fitted the sounds' times are relative to ``about``, the starts to ``first_starts``: small numbers.
    weight, solution, covariance = sigma**-2.0, np.zeros(len(prior)), np.zeros((0, 0))
    for _ in range(_ROUNDS):
        normal = (design * weight[:, None]).T @ design + np.diag(prior)
        covariance = np.linalg.pinv(normal[np.ix_(free, free)], hermitian=True)
        solution[free] = covariance @ ((design * weight[:, None]).T @ offset)[free]
        residuals = design @ solution - offset
        weight = sigma**-2.0 / (1.0 + (residuals / (_CAUCHY * sigma)) ** 2)
    variance = np.zeros(len(prior))
    variance[free] = np.diag(covariance)
    ways_s = np.sqrt(2.0) * settings.distance_sigma / SOUND_SPEED * (np.arange(cameras) != reference)
    return Clocks(
        first_starts + solution[:cameras],
        solution[cameras : 2 * cameras],
        np.sqrt(variance[:cameras] + ways_s**2),
        np.sqrt(variance[cameras : 2 * cameras]),
        about + solution[2 * cameras :],
        residuals,
    )


_ADJUSTMENTS = 12
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
    for _ in range(_ADJUSTMENTS):
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
