"""Clocks from the sound as a whole, where no clap tells: all pairs of cameras, then one robust fit of all."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clock_fit import SOUND_SPEED
from bodycam_ros.ingest.envelope_match import EnvelopeMatch, match_envelopes
from bodycam_ros.ingest.sound_peaks import CameraSound
from bodycam_ros.ingest.sound_settings import ClockSettings, WholeSoundSettings

Array = NDArray[np.float64]

_ROUNDS = 40
_CAUCHY = 2.4


@dataclass(frozen=True, eq=False)
class WholeSoundResult:
    """What the sound as a whole says; cameras that it cannot place are not in it.

    Attributes:
        reference: whose time it is; empty if nothing is known.
        times: camera -> its clock, of those that were not known before; with the reference if none was.
        confidence: camera -> 0 to 1: lead over the second best, by the share of pairs that agree.
    """

    reference: str = ""
    times: Mapping[str, CameraTime] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Pair:
    one: str
    other: str
    match: EnvelopeMatch

    @property
    def lag_s(self) -> float:
        """By how much the other camera starts later, at the middle of what both heard [s]."""
        return float(np.median(self.match.firsts_s - self.match.seconds_s))


def compare_sounds(
    heard: Mapping[str, CameraSound],
    known: Mapping[str, CameraTime],
    settings: WholeSoundSettings,
    clock_settings: ClockSettings,
    on_pair: Callable[[int, int], None] = lambda done, of: None,
) -> WholeSoundResult:
    """Place the cameras of which nothing is known yet.

    Args:
        heard: of all cameras.
        known: clocks that stay as they are.
        settings: of the comparison.
        clock_settings: of the fit; the reference, if nothing is known yet.
        on_pair: told how many of how many pairs were compared.
    """
    wanted = [pair for pair in combinations(heard, 2) if not (pair[0] in known and pair[1] in known)]
    pairs, tried = [], {name: 0 for name in heard}
    for number, (one, other) in enumerate(wanted):
        match = match_envelopes(heard[one], heard[other], settings.largest_drift)
        on_pair(number + 1, len(wanted))
        if match is None:
            continue
        tried[one] += 1
        tried[other] += 1
        if match.strength >= settings.min_strength and match.lead >= settings.min_lead and len(match.firsts_s):
            pairs.append(_Pair(one, other, match))
    fixed = dict(known)
    if not fixed:
        if not pairs:
            return WholeSoundResult()
        reference = _reference(pairs, clock_settings)
        fixed[reference] = CameraTime(reference, 0.0, 0.0, 0.0, 0.0, "sound")
    else:
        reference = min(known, key=lambda name: known[name].start_sigma_s)
    starts = _tree(pairs, fixed)
    agreeing = _agreeing(pairs, starts, settings)
    # A camera that most of its pairs contradict is where one pair put it, by chance.
    placed = [name for name in starts if name not in fixed and agreeing.get(name, 0.0) >= 0.5]
    kept = [pair for pair in pairs if all(name in fixed or name in placed for name in (pair.one, pair.other))]
    kept = [pair for pair in kept if abs(_contradiction(pair, starts)) <= settings.agreement]
    times = _fit(kept, placed, starts, fixed, settings, clock_settings)
    confidence = {
        name: agreeing[name] * max((p.match.lead for p in kept if name in (p.one, p.other)), default=0.0)
        for name in times
    }
    if not known and times:
        times = {reference: fixed[reference], **times}
        confidence[reference] = max(confidence.values())
    return WholeSoundResult(reference if times else "", times, confidence)


def _reference(pairs: list[_Pair], settings: ClockSettings) -> str:
    worth: dict[str, float] = {}
    for pair in pairs:
        for name in (pair.one, pair.other):
            worth[name] = worth.get(name, 0.0) + pair.match.lead
    return settings.reference if settings.reference in worth else max(worth, key=lambda name: worth[name])


def _tree(pairs: list[_Pair], fixed: Mapping[str, CameraTime]) -> dict[str, float]:
    """First starts [s] of the cameras that pairs lead to, along the surest."""
    starts = {name: time.start_s for name, time in fixed.items()}
    ranked = sorted(pairs, key=lambda pair: -pair.match.lead * pair.match.strength)
    while True:
        link = next((pair for pair in ranked if (pair.one in starts) != (pair.other in starts)), None)
        if link is None:
            return starts
        if link.one in starts:
            starts[link.other] = starts[link.one] + link.lag_s
        else:
            starts[link.one] = starts[link.other] - link.lag_s


def _contradiction(pair: _Pair, starts: Mapping[str, float]) -> float:
    return starts[pair.other] - starts[pair.one] - pair.lag_s


def _agreeing(pairs: list[_Pair], starts: Mapping[str, float], settings: WholeSoundSettings) -> dict[str, float]:
    """Camera -> share of its pairs that agree with where all cameras are; 0 where a lone pair closes no cycle."""
    counts: dict[str, list[bool]] = {}
    for pair in pairs:
        if pair.one in starts and pair.other in starts:
            agrees = abs(_contradiction(pair, starts)) <= settings.agreement
            counts.setdefault(pair.one, []).append(agrees)
            counts.setdefault(pair.other, []).append(agrees)
    enough = 1 if len(starts) <= 2 else 2
    return {name: float(np.mean(agrees)) if sum(agrees) >= enough else 0.0 for name, agrees in counts.items()}


def _fit(
    pairs: list[_Pair],
    names: list[str],
    starts: Mapping[str, float],
    fixed: Mapping[str, CameraTime],
    settings: WholeSoundSettings,
    clock_settings: ClockSettings,
) -> dict[str, CameraTime]:
    """Robust least squares over all pieces of all pairs: both cameras' times of a piece are the same."""
    column = {name: number for number, name in enumerate(names)}
    count = len(names)
    if not count or not pairs:
        return {}
    rows, targets = [], []
    for pair in pairs:
        for first_s, second_s in zip(pair.match.firsts_s, pair.match.seconds_s, strict=True):
            row, target = np.zeros(2 * count), second_s - first_s
            for name, media_s, sign in ((pair.one, first_s, 1.0), (pair.other, second_s, -1.0)):
                if name in column:
                    row[column[name]], row[count + column[name]] = sign, sign * media_s
                    target -= sign * starts[name]
                else:
                    target -= sign * (fixed[name].start_s + fixed[name].drift * media_s)
            rows.append(row)
            targets.append(target)
    design, target_s = np.array(rows), np.array(targets)
    prior = np.concatenate((np.full(count, 1e-6), np.full(count, clock_settings.drift_sigma**-2.0)))
    weight, solution, covariance = np.full(len(target_s), settings.sigma**-2.0), np.zeros(2 * count), np.zeros((0, 0))
    for _ in range(_ROUNDS):
        covariance = np.linalg.inv((design * weight[:, None]).T @ design + np.diag(prior))
        solution = covariance @ (design.T @ (weight * target_s))
        residuals = design @ solution - target_s
        weight = settings.sigma**-2.0 / (1.0 + (residuals / (_CAUCHY * settings.sigma)) ** 2)
    sigma = np.sqrt(np.diag(covariance))
    ways_s = np.sqrt(2.0) * clock_settings.distance_sigma / SOUND_SPEED
    # Pairs share cameras, and pieces what is odd about a camera: their number does not make it surer without end.
    least = np.hypot(ways_s, 0.5 * settings.sigma)
    return {
        name: CameraTime(
            name,
            starts[name] + float(solution[number]),
            float(solution[count + number]),
            float(np.hypot(sigma[number], least)),
            float(sigma[count + number]),
            "sound",
        )
        for name, number in column.items()
    }
