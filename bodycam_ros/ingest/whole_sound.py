"""Clocks from the sound as a whole, where no clap tells: all pairs of cameras, then one robust fit of all."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from bodycam_ros.ingest.arrival import arrivals
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clap_places import clusters, peak_weight
from bodycam_ros.ingest.offset_agreement import SOUND_SPEED, HeardSounds
from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, CameraSound, SoundPeak
from bodycam_ros.ingest.sound_settings import ClapSettings, ClockSettings, WholeSoundSettings

Array = NDArray[np.float64]

_ROUGH_SIGMA_S = 2e-3  # of a peak by its time alone


@dataclass(frozen=True, eq=False)
class SoundGroup:
    """Peaks of several cameras that are one sound: number of the camera -> its peak; worth; share that heard it."""

    members: Mapping[int, SoundPeak]
    weight: float
    share: float
    about_s: float


def common_sounds(
    sounds: Sequence[CameraSound], shifts: Array, drifts: Array, settings: ClapSettings
) -> list[SoundGroup]:
    """Sounds that two cameras or more heard, by all their peaks."""
    entries = [
        (shifts[camera] + (1.0 + drifts[camera]) * peak.media_s, camera, peak)
        for camera, sound in enumerate(sounds)
        for peak in sound.peaks
    ]
    entries.sort(key=lambda entry: entry[0])
    times = np.array([entry[0] for entry in entries])
    owners = np.array([entry[1] for entry in entries])
    starts = shifts + (1.0 + drifts) * np.array([sound.start_s for sound in sounds])
    ends = shifts + (1.0 + drifts) * np.array([sound.end_s for sound in sounds])
    groups = []
    for group in clusters(times, owners, settings.tolerance):
        if len(group) < 2:
            continue
        about = float(times[group].mean())
        listening = max(len(group), int(((about > starts) & (about < ends)).sum()))
        members = {int(owners[number]): entries[number][2] for number in group}
        weight = sum(peak_weight(peak) for peak in members.values()) / listening
        groups.append(SoundGroup(members, weight, len(group) / listening, about))
    return groups


def worthiest(groups: Sequence[SoundGroup], settings: ClapSettings) -> list[SoundGroup]:
    """The sounds that clocks are fitted to: the worthiest, and of those before and after half time as many."""
    if not groups:
        return []
    half_time = 0.5 * (groups[0].about_s + groups[-1].about_s)
    chosen: list[SoundGroup] = []
    for side in (True, False):
        there = [group for group in groups if (group.about_s <= half_time) == side]
        chosen += sorted(there, key=lambda group: -group.weight)[: settings.most_sounds // 2]
    floor = 0.1 * max(group.weight for group in chosen)
    return sorted((group for group in chosen if group.weight >= floor), key=lambda group: group.about_s)


def heard_sounds(groups: Sequence[SoundGroup], exact: bool) -> HeardSounds:
    """When each was heard; ``exact``: by the waveforms, which takes longer."""
    sound, camera, media, sigma = [], [], [], []
    for number, group in enumerate(groups):
        peaks = list(group.members.values())
        times, sigmas = (
            arrivals(peaks) if exact else (np.array([p.media_s for p in peaks]), np.full(len(peaks), _ROUGH_SIGMA_S))
        )
        sound += [number] * len(peaks)
        camera += list(group.members)
        media += list(times)
        sigma += list(sigmas)
    return HeardSounds(np.array(sound), np.array(camera), np.array(media), np.array(sigma))


_COARSE = 5  # steps of the envelope that make one of the search
_PIECE_S = 300.0  # of a long sound: clocks that differ by 100 ppm smear it by 30 ms
_LEAST_OVERLAP_S = 2.0
_WINDOW_S, _MOST_WINDOWS = 30.0, 24
_NEAR_S = 0.06
_APART_S = 0.25  # a second best within this is the flank of the best


@dataclass(frozen=True, eq=False)
class EnvelopeMatch:
    """How a second sound lies on a first.

    Attributes:
        firsts_s: (K,) media times of the first camera [s].
        seconds_s: (K,) media times of the second at which the same was heard [s].
        strength: of the correlation at best, in standard deviations of what it is elsewhere.
        lead: over the second best, 0 to 1.
    """

    firsts_s: Array
    seconds_s: Array
    strength: float
    lead: float


def match_envelopes(first: CameraSound, second: CameraSound, largest_drift: float) -> EnvelopeMatch | None:
    """Search all shifts, then look closer at pieces of what both heard; None if either is silent or too short."""
    one, other = _levelled(first.envelope), _levelled(second.envelope)
    if len(one) * ENVELOPE_S < _LEAST_OVERLAP_S or len(other) * ENVELOPE_S < _LEAST_OVERLAP_S:
        return None
    if not one.any() or not other.any():
        return None
    best: tuple[float, float, int, int] | None = None
    whole = _coarse(other)
    piece = int(_PIECE_S / ENVELOPE_S)
    for begin in sorted({0, max(0, (len(one) - piece) // 2), max(0, len(one) - piece)}):
        strength, lead, lag = _search(_coarse(one[begin : begin + piece]), whole)
        if best is None or strength > best[0]:
            best = (strength, lead, lag * _COARSE - begin, begin + min(piece, len(one)) // 2)
    assert best is not None
    strength, lead, lag, middle = best
    firsts, seconds = _pieces(one, other, lag, middle, largest_drift)
    return EnvelopeMatch(first.start_s + ENVELOPE_S * firsts, second.start_s + ENVELOPE_S * seconds, strength, lead)


def _levelled(envelope: NDArray[np.float16]) -> Array:
    """Large rises count less than in proportion, so that one clap is not all."""
    values: Array = np.sqrt(np.maximum(envelope.astype(np.float64), 0.0))
    return values - values.mean() if len(values) else values


def _coarse(values: Array) -> Array:
    count = len(values) // _COARSE
    sums: Array = values[: count * _COARSE].reshape(count, _COARSE).sum(axis=1)
    return sums


def _search(piece: Array, whole: Array) -> tuple[float, float, int]:
    """(strength, lead, steps by which what the piece begins with lies behind the beginning of the whole)."""
    length = next_fast_len(len(piece) + len(whole), real=True)
    correlation = irfft(np.conj(rfft(piece, length)) * rfft(whole, length), length)
    lags = np.arange(-len(piece) + 1, len(whole))
    values = correlation[lags]
    overlap = np.minimum(len(piece), len(whole) - lags) - np.maximum(0, -lags)
    least = min(_LEAST_OVERLAP_S / (ENVELOPE_S * _COARSE), 0.5 * min(len(piece), len(whole)))
    # Not by how long they overlap: one clap met by chance at the very ends must not outdo two that meet.
    values = np.where(overlap >= least, values, 0.0)
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values)))) or float(values.std()) or 1.0
    at = int(np.argmax(values))
    apart = int(_APART_S / (ENVELOPE_S * _COARSE))
    rest = np.concatenate((values[: max(0, at - apart)], values[at + apart + 1 :]))
    second = max(0.0, float(rest.max())) if len(rest) else 0.0
    largest = float(values[at])
    return largest / spread, 1.0 - second / largest if largest > 0.0 else 0.0, int(lags[at])


def _pieces(one: Array, other: Array, lag: int, middle: int, largest_drift: float) -> tuple[Array, Array]:
    """Steps (K,) of the first and (K,) of the second sound that hold the same, of pieces of their overlap."""
    begin, end = max(0, -lag), min(len(one), len(other) - lag)
    window = int(min(_WINDOW_S / ENVELOPE_S, end - begin))
    count = max(1, min(_MOST_WINDOWS, (end - begin) // window))
    firsts, seconds = [], []
    for start in np.linspace(begin, end - window, count).astype(int):
        reach = int(_NEAR_S / ENVELOPE_S + largest_drift * abs(start + window / 2 - middle))
        part = one[start : start + window]
        low, high = max(0, start + lag - reach), min(len(other), start + lag + window + reach)
        length = next_fast_len(len(part) + high - low, real=True)
        correlation = irfft(np.conj(rfft(part, length)) * rfft(other[low:high], length), length)
        candidates = np.arange(start + lag - reach - low, start + lag + reach - low + 1)
        near = correlation[candidates]
        best = int(np.argmax(near))
        if not 0 < best < len(near) - 1 or not part.any():
            continue
        bend = near[best - 1] - 2.0 * near[best] + near[best + 1]
        fraction = 0.5 * (near[best - 1] - near[best + 1]) / bend if bend < 0.0 else 0.0
        weight = np.maximum(part, 0.0)
        centre = start + float(np.average(np.arange(window), weights=weight + 1e-12))
        firsts.append(centre)
        seconds.append(centre - start + low + candidates[best] + fraction)
    return np.array(firsts), np.array(seconds)


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
