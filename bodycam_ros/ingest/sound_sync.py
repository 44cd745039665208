"""Clocks of cameras by what their microphones recorded (A section 3).

The envelopes of all pairs are correlated; the offsets on which all pairs agree place the cameras to some milliseconds.
Sudden sounds that several cameras share, claps the loudest of them, then give the clocks by their waveforms.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from bodycam_ros.ingest.clock_fit import SOUND_SPEED, CameraTime, ClockFit, SharedEvents, fit_clocks
from bodycam_ros.ingest.offset_search import OffsetCurve, Pair, agreed_offsets
from bodycam_ros.ingest.sound_arrival import arrivals
from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, CameraSound, SoundPeak

Array = NDArray[np.float64]

_COARSE = 5  # steps of the envelope that make one of the search
_COARSE_S = _COARSE * ENVELOPE_S
_PIECE_S = 300.0  # of a long sound: clocks that differ by 100 ppm smear it by 30 ms
_MAX_OFFSET_S = 1800.0
_LEAST_OVERLAP_S = 2.0
_MIN_STRENGTH = 8.0  # sigmas; minutes of unlike noise reach 6.7 at some offset
_MIN_CONFIDENCE = 0.15  # lead over the second best offset
_APART_S = 0.25  # a second best within this is the flank of the best
_NEAR_ENDS_S = 3.0  # cameras are started one after the other, and stopped so: up to twice the evidence of one clap

_WINDOW_S, _MOST_WINDOWS = 30.0, 24
_NEAR_S = 0.06
_WINDOW_STRENGTH = 6.0  # sigmas
_WINDOW_SIGMA_S = 0.003  # from steps of 2 ms of what rises for 4
_LARGEST_DRIFT = 200e-6  # twice what a crystal in the cold differs from one in the sun

_TOLERANCE_S = 0.008  # of one sound: travel over 2 m, and 2 ms by which AAC smears a beginning
_MOST_SOUNDS = 60
_LEAST_WEIGHT = 0.1  # of the weightiest sound
_CLAP_SHARE, _CLAP_LOUDNESS = 0.5, 0.25  # of the cameras that ran; of the loudest common sound
_CLAP_WEIGHT = 0.25  # a bump has 0.1, a clap at arm's length 1
_DISTANCE_SIGMA_M = 0.3  # spread of the distances from a clap to the cameras of a body
_MOVED_SIGMA_M, _SAME_POSTURE_S = 0.1, 2.0  # by how much these differ between claps; nearer ones count as one


@dataclass(frozen=True, eq=False)
class CommonSound:
    """A sound that two cameras or more recorded.

    Attributes:
        recording_s: when it reached the reference by the fit [s].
        heard_s: camera -> media time at which it reached it [s].
        late_s: camera -> by how much later it reached it than the fit gives: travel, and error [s].
        peaks: camera -> its peak.
        share: of the cameras that ran, which recorded it.
        clap: whether it is a clap, or as loud as one.
    """

    recording_s: float
    heard_s: Mapping[str, float]
    late_s: Mapping[str, float]
    peaks: Mapping[str, SoundPeak]
    share: float
    clap: bool

    @property
    def weight(self) -> float:
        """How clearly it is a sudden sound, less by the cameras that did not record it, 0 to 1."""
        return self.share * float(np.mean([peak.weight for peak in self.peaks.values()]))

    def relative_to(self, camera: CameraTime) -> "CommonSound":
        """The same sound in the time of another camera, of which the clock in the present time is given."""
        return replace(self, recording_s=(self.recording_s - camera.start_s) / (1.0 + camera.drift))


@dataclass(frozen=True, eq=False)
class SoundTimes:
    """Clocks by sound; cameras that it cannot place are not in it.

    Attributes:
        times: camera -> its clock, in the time of one of them.
        confidence: camera -> 0 to 1, the lead over the second best offset.
        sounds: in order of time.
    """

    times: Mapping[str, CameraTime] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)
    sounds: tuple[CommonSound, ...] = ()


def sound_times(
    sounds: Mapping[str, CameraSound],
    reference: str = "",
    on_pair: Callable[[int, int], None] = lambda done, count: None,
) -> SoundTimes:
    """Clocks of cameras by sound.

    Args:
        sounds: camera -> its sound.
        reference: camera whose time is the recording's, if it can be placed; else the one with most evidence.
        on_pair: called with how many of how many pairs were compared.
    """
    curves: dict[Pair, OffsetCurve] = {}
    pairs = list(combinations(sounds, 2))
    for number, (first, second) in enumerate(pairs):
        curve = _envelope_curve(sounds[first], sounds[second])
        if curve is not None:
            curves[first, second] = curve
        on_pair(number + 1, len(pairs))
    if not curves:
        return SoundTimes()
    evidence = {name: sum(float(c.values.max()) for pair, c in curves.items() if name in pair) for name in sounds}
    root = max(evidence, key=lambda name: evidence[name])
    agreed = agreed_offsets(root, curves, apart=round(_APART_S / _COARSE_S))
    placed = [name for name in sounds if name in agreed and agreed[name].confidence >= _MIN_CONFIDENCE]
    if root not in placed or len(placed) < 2:
        return SoundTimes()
    reference = reference if reference in placed else root
    # Offsets are between the beginnings of sounds.
    starts = {name: _COARSE_S * agreed[name].samples - sounds[name].start_s for name in placed}
    windows = {
        pair: records
        for pair in combinations(placed, 2)
        if (
            records := _window_records(
                sounds[pair[0]], sounds[pair[1]], starts[pair[1]] - starts[pair[0]], placed, pair
            )
        )
    }
    floor_s = np.sqrt(2.0) * _DISTANCE_SIGMA_M / SOUND_SPEED
    rough = fit_clocks(
        placed,
        SharedEvents.from_records([record for records in windows.values() for record in records]),
        reference,
        "sound",
        float(np.hypot(floor_s, 0.5 * _WINDOW_SIGMA_S)),
    )
    fit, found = _fit_common_sounds(sounds, rough, windows, reference, float(floor_s))
    by_claps = {name for sound in found if sound.clap for name in sound.heard_s}
    times = {n: replace(t, source="claps" if by_claps and n in by_claps else "sound") for n, t in fit.times.items()}
    return SoundTimes(times, {name: agreed[name].confidence for name in times}, found)


def _envelope_curve(first: CameraSound, second: CameraSound) -> OffsetCurve | None:
    """Evidence for each offset by the piece of the first sound that fits best; None where no offset stands out."""
    one, other = (_levelled(sound.envelope) for sound in (first, second))
    if min(len(one), len(other)) * ENVELOPE_S < _LEAST_OVERLAP_S or not one.any() or not other.any():
        return None
    one, other = (v[: len(v) // _COARSE * _COARSE].reshape(-1, _COARSE).sum(axis=1) for v in (one, other))
    piece = int(_PIECE_S / _COARSE_S)
    best: tuple[float, NDArray[np.int64], Array] | None = None
    for begin in sorted({0, max(0, (len(one) - piece) // 2), max(0, len(one) - piece)}):
        part = one[begin : begin + piece]
        shifts = np.arange(-len(part) + 1, len(other))
        values = _correlation(part, other)[shifts]
        overlap = np.minimum(len(part), len(other) - shifts) - np.maximum(0, -shifts)
        least = min(_LEAST_OVERLAP_S / _COARSE_S, 0.5 * min(len(part), len(other)))
        # Not by how long they overlap: one clap met by chance at the very ends must not outdo two that meet.
        values = np.where(overlap >= least, values, 0.0)
        spread = 1.4826 * float(np.median(np.abs(values - np.median(values)))) or float(values.std()) or 1.0
        if best is None or values.max() / spread > best[0]:
            best = float(values.max()) / spread, begin - shifts, values / spread
    assert best is not None
    strength, offsets, values = best
    if strength < _MIN_STRENGTH:
        return None
    near = np.abs(offsets) <= _MAX_OFFSET_S / _COARSE_S
    offsets, values = offsets[near][::-1], values[near][::-1]
    gap_s = _COARSE_S * np.minimum(np.abs(offsets), np.abs(offsets + len(other) - len(one)))
    return OffsetCurve(int(offsets[0]), values * (1.0 + np.exp(-gap_s / _NEAR_ENDS_S)))


def _levelled(envelope: NDArray[np.float16]) -> Array:
    """Large rises count less than in proportion, so that one clap is not all."""
    values: Array = np.sqrt(np.maximum(envelope.astype(np.float64), 0.0))
    return values - values.mean() if len(values) else values


def _correlation(part: Array, whole: Array) -> Array:
    """Sums over k of part[k] whole[k + shift]; index it by the shift, negative ones from the end."""
    length = next_fast_len(len(part) + len(whole), real=True)
    correlation: Array = irfft(np.conj(rfft(part, length)) * rfft(whole, length), length)
    return correlation


Records = list[list[tuple[int, float, float]]]


def _window_records(
    first: CameraSound, second: CameraSound, offset_s: float, names: Sequence[str], pair: Pair
) -> Records:
    """Records of windows of what both cameras recorded, for ``SharedEvents``, where their envelopes agree clearly.

    Args:
        first, second: the sounds.
        offset_s: start of the second less that of the first, to some hundredths [s].
        names: cameras, as the records count them.
        pair: names of the two.
    """
    one, other = _levelled(first.envelope), _levelled(second.envelope)
    lag = round((first.start_s - second.start_s - offset_s) / ENVELOPE_S)
    begin, end = max(0, -lag), min(len(one), len(other) - lag)
    window = int(min(_WINDOW_S / ENVELOPE_S, end - begin))
    if window < 2:
        return []
    records: Records = []
    count = max(1, min(_MOST_WINDOWS, (end - begin) // window))
    for start in np.linspace(begin, end - window, count).astype(int):
        reach = int((_NEAR_S + _LARGEST_DRIFT * ENVELOPE_S * max(len(one), len(other))) / ENVELOPE_S)
        part = one[start : start + window]
        low, high = max(0, start + lag - reach), min(len(other), start + lag + window + reach)
        candidates = np.arange(start + lag - reach - low, start + lag + reach - low + 1)
        near = _correlation(part, other[low:high])[candidates]
        best = int(np.argmax(near))
        chance = float(np.linalg.norm(part)) * float(other[low:high].std())
        if not 0 < best < len(near) - 1 or near[best] < _WINDOW_STRENGTH * chance:
            continue
        bend = near[best - 1] - 2.0 * near[best] + near[best + 1]
        fraction = 0.5 * (near[best - 1] - near[best + 1]) / bend if bend < 0.0 else 0.0
        centre = start + float(np.average(np.arange(window), weights=np.maximum(part, 0.0) + 1e-12))
        at = (centre, centre - start + low + candidates[best] + fraction)
        sigma_s = _WINDOW_SIGMA_S / np.sqrt(2.0)
        records.append(
            [
                (list(names).index(name), sound.start_s + ENVELOPE_S * step, sigma_s)
                for name, sound, step in zip(pair, (first, second), at, strict=True)
            ]
        )
    return records


def _fit_common_sounds(
    sounds: Mapping[str, CameraSound], rough: ClockFit, windows: Mapping[Pair, Records], reference: str, floor_s: float
) -> tuple[ClockFit, tuple[CommonSound, ...]]:
    """Clocks by the common sounds, and by the windows of the cameras that share none; and these sounds."""
    names = list(rough.times)
    common = _weightiest(_common_sounds(sounds, rough.times))
    about = np.array([sound.recording_s for sound in common])
    records: Records = []
    for number, sound in enumerate(common):
        media_s, sigma_s = arrivals(list(sound.peaks.values()))
        crowd = int((np.abs(about - sound.recording_s) <= _SAME_POSTURE_S).sum())
        sigma_s = np.sqrt(sigma_s**2 + (_MOVED_SIGMA_M / SOUND_SPEED) ** 2 * crowd)
        cameras = [names.index(name) for name in sound.peaks]
        records.append(list(zip(cameras, media_s.tolist(), sigma_s.tolist(), strict=True)))
        common[number] = replace(sound, heard_s=dict(zip(sound.peaks, media_s.tolist(), strict=True)))
    shared = {name for sound in common for name in sound.peaks}
    for pair, more in windows.items():
        if not set(pair) <= shared and set(pair) <= set(names):
            records += [[(names.index(n), *r[1:]) for n, r in zip(pair, record, strict=True)] for record in more]
    fit = fit_clocks(names, SharedEvents.from_records(records), reference, "sound", floor_s)
    loudness = _loudness(common)
    first = 0
    for number, (sound, loud) in enumerate(zip(common, loudness, strict=True)):
        late_s = fit.residuals_s[first : first + len(sound.peaks)]
        first += len(sound.peaks)
        is_loud = loud >= _CLAP_LOUDNESS * max(loudness)
        common[number] = replace(
            sound,
            recording_s=float(fit.events_s[number]),
            late_s=dict(zip(sound.peaks, late_s.tolist(), strict=True)),
            clap=is_loud and sound.share >= _CLAP_SHARE and sound.weight >= _CLAP_WEIGHT,
        )
    found = (sound for sound in common if np.isfinite(sound.recording_s))
    return fit, tuple(sorted(found, key=lambda sound: sound.recording_s))


def _common_sounds(sounds: Mapping[str, CameraSound], times: Mapping[str, CameraTime]) -> list[CommonSound]:
    """Sounds that two cameras or more recorded: peaks within the tolerance, at most one of a camera."""
    entries = sorted(
        (float(time.recording_s(np.array([peak.media_s]))[0]), name, number)
        for name, time in times.items()
        for number, peak in enumerate(sounds[name].peaks)
    )
    clusters: list[list[tuple[float, str, int]]] = []
    for entry in entries:
        last = clusters[-1] if clusters else []
        if last and entry[0] - last[0][0] <= _TOLERANCE_S and entry[1] not in {member[1] for member in last}:
            last.append(entry)
        else:
            clusters.append([entry])
    ends = [time.recording_s(np.array([sounds[n].start_s, sounds[n].end_s])) for n, time in times.items()]
    common = []
    for cluster in (each for each in clusters if len(each) > 1):
        about_s = float(np.mean([entry[0] for entry in cluster]))
        running = max(len(cluster), sum(bool(start < about_s < end) for start, end in ends))
        peaks = {name: sounds[name].peaks[number] for _, name, number in cluster}
        common.append(CommonSound(about_s, {}, {}, peaks, len(cluster) / running, False))
    return common


def _weightiest(sounds: Sequence[CommonSound]) -> list[CommonSound]:
    """The sounds that clocks are fitted to: the weightiest, and of those before and after half time as many."""
    if not sounds:
        return []
    half_time = 0.5 * (sounds[0].recording_s + sounds[-1].recording_s)
    chosen: list[CommonSound] = []
    for is_early in (True, False):
        side = [sound for sound in sounds if (sound.recording_s <= half_time) == is_early]
        chosen += sorted(side, key=lambda sound: -sound.weight)[: _MOST_SOUNDS // 2]
    floor = _LEAST_WEIGHT * max(sound.weight for sound in chosen)
    return [sound for sound in chosen if sound.weight >= floor]


def _loudness(sounds: Sequence[CommonSound]) -> list[float]:
    """How loud each sound is, whatever the cameras' gains: the median of its share of each camera's loudest."""
    loudest: dict[str, float] = {}
    for sound in sounds:
        for name, peak in sound.peaks.items():
            loudest[name] = max(loudest.get(name, 1e-9), peak.amplitude)
    return [float(np.median([p.amplitude / loudest[n] for n, p in sound.peaks.items()])) for sound in sounds]
