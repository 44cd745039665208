"""Cameras laid upon each other by their sudden sounds, one after the other, the surest first (A section 3).

Each finds the most consistent spacing of its peaks with the sounds that the cameras before it share. A sound that only
one camera heard loses its weight with every camera that ran and did not hear it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.arrival import LIKE, likeness, spectrum
from bodycam_ros.ingest.clap_search import Spacing, WeightedTimes, spacings
from bodycam_ros.ingest.sound_peaks import CameraSound, SoundPeak
from bodycam_ros.ingest.sound_settings import ClapSettings

Array = NDArray[np.float64]

_LOUD_DB = 30.0  # rise of a clap at arm's length; louder is not worth more
_FIRST_ONES = 6  # loudest cameras, of which two are laid upon each other first
_AS_SURE = 0.7  # of the surest: these are laid in one round
_EDGE_S = 120.0  # claps are within this of the beginning and the end


class Listener:
    """A camera's peaks that take part in the search."""

    def __init__(self, sound: CameraSound, settings: ClapSettings) -> None:
        weights = np.array([peak_weight(peak) for peak in sound.peaks])
        times = np.array([peak.media_s for peak in sound.peaks])
        order = np.argsort(-weights, kind="stable")
        third = settings.most_peaks // 3
        early = order[times[order] < sound.start_s + _EDGE_S][:third]
        late = order[times[order] > sound.end_s - _EDGE_S][:third]
        kept = np.unique(np.concatenate((order[: settings.most_peaks - 2 * third], early, late)))
        self.peaks = [sound.peaks[number] for number in kept]
        self.times = WeightedTimes(
            times[kept], weights[kept], np.array([[sound.start_s, sound.end_s]]), np.zeros(len(kept), dtype=bool)
        )
        self.spectra = [spectrum(peak) for peak in self.peaks]


def peak_weight(peak: SoundPeak) -> float:
    """How much a peak is worth, 0 to 1."""
    return float(np.clip(peak.rise_db / _LOUD_DB, 0.0, 1.0) ** 2) * peak.sharpness


@dataclass(frozen=True)
class Place:
    """Where a camera's media time lies: ``time = shift + (1 + drift) * media_s``, and how sure that is, 0 to 1."""

    shift: float
    drift: float
    confidence: float


def places_of(listeners: Mapping[str, Listener], settings: ClapSettings) -> dict[str, Place]:
    """Where cameras lie in the time of one of them, by growing from the two that agree best."""
    best: tuple[float, str, str] | None = None
    eager = sorted(listeners, key=lambda name: -listeners[name].times.weights.sum())[:_FIRST_ONES]
    for one, other in [*combinations(eager, 2), *combinations(listeners, 2)]:
        if best is not None and not {one, other} <= set(eager):
            break
        ways = _ways([listeners[one]], [Place(0.0, 0.0, 1.0)], listeners[other], settings)
        if ways and _is_sure(ways, settings):
            rank = ways[0].rank * _confidence(ways)
            if best is None or rank > best[0]:
                best = (rank, one, other)
    if best is None:
        return {}
    places = {best[1]: Place(0.0, 0.0, 1.0)}
    waiting = [name for name in listeners if name != best[1]]
    while waiting:
        bases, at = [listeners[name] for name in places], list(places.values())
        offers = {name: _ways(bases, at, listeners[name], settings) for name in waiting}
        if len(places) == 1:
            offers = {best[2]: offers[best[2]]}
        sure = {name: ways for name, ways in offers.items() if ways and _is_sure(ways, settings)}
        if not sure:
            break
        ranks = {name: ways[0].rank * _confidence(ways) for name, ways in sure.items()}
        for name in [name for name in sure if ranks[name] >= _AS_SURE * max(ranks.values())]:
            places[name] = Place(sure[name][0].shift, sure[name][0].drift, min(1.0, _confidence(sure[name])))
            waiting.remove(name)
    if best[2] not in places:
        return {}
    return places | {best[1]: replace(places[best[1]], confidence=places[best[2]].confidence)}


def _ways(
    bases: Sequence[Listener], places: Sequence[Place], candidate: Listener, settings: ClapSettings
) -> list[Spacing]:
    """How a camera may lie upon others that have their places, best first."""
    moved = [place.shift + (1.0 + place.drift) * base.times.times for base, place in zip(bases, places, strict=True)]
    spans = np.array(
        [place.shift + (1.0 + place.drift) * base.times.spans[0] for base, place in zip(bases, places, strict=True)]
    )
    owners = np.concatenate([np.full(len(times), number) for number, times in enumerate(moved)])
    numbers = np.concatenate([np.arange(len(times)) for times in moved])
    times = np.concatenate(moved)
    weights = np.concatenate([base.times.weights for base in bases])
    order = np.argsort(times, kind="stable")
    groups = clusters(times[order], owners[order], settings.tolerance)
    members = [order[group] for group in groups]
    at = np.array([times[group].mean() for group in members])
    listening = np.array([max(1, int(((time > spans[:, 0]) & (time < spans[:, 1])).sum())) for time in at], dtype=float)
    worth = np.array([weights[group].sum() for group in members]) / np.maximum(
        listening, np.array([len(group) for group in members])
    )
    strongest = [int(group[np.argmax(weights[group])]) for group in members]

    def alike(first: int, second: int) -> float:
        member = strongest[first]
        return likeness(bases[owners[member]].spectra[numbers[member]], candidate.spectra[second])[0]

    worthiest = np.argsort(-worth, kind="stable")[: settings.most_peaks]
    ordered = worthiest[np.argsort(at[worthiest], kind="stable")]
    shared = np.array([len(group) > 1 for group in members])
    first = WeightedTimes(at[ordered], worth[ordered], spans, shared[ordered])
    return spacings(
        first,
        candidate.times,
        settings.tolerance,
        settings.largest_drift,
        lambda one, other: alike(int(ordered[one]), other),
    )


def clusters(times: Array, owners: NDArray[np.int64], tolerance: float) -> list[NDArray[np.int64]]:
    """Groups of ordered times (N,) that lie together, at most one of an owner; numbers into the times."""
    groups: list[list[int]] = []
    for number, time in enumerate(times):
        if groups and time - times[groups[-1][0]] <= tolerance and owners[number] not in owners[groups[-1]]:
            groups[-1].append(number)
        else:
            groups.append([number])
    return [np.array(group) for group in groups]


def _is_sure(ways: Sequence[Spacing], settings: ClapSettings) -> bool:
    """Whether the best may be believed: any two sounds meet somewhere, so a single one must be alike as well."""
    best = ways[0]
    meets = len(best.firsts) > 1 or best.alike >= LIKE
    return meets and best.score >= settings.min_score and _confidence(ways) >= settings.min_confidence


def _confidence(ways: Sequence[Spacing]) -> float:
    """Lead of the best over the second best, 0 to 1."""
    if ways[0].score <= 0.0:
        return 0.0
    second = max(0.0, ways[1].rank) if len(ways) > 1 else 0.0
    return float(1.0 - second / ways[0].rank)
