"""Clocks of cameras by what their microphones recorded (A section 3).

The envelopes of all pairs are correlated; the offsets on which all pairs agree place the cameras to some milliseconds.
Windows of each pair then give offset and drift to a millisecond or two: a clap is in all of them. Waveforms would be
exact to a tenth, but the first picture of an MP4 may be exposed a frame after its first sound.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from bodycam_ros.ingest.clock_fit import FoundTimes, fit_clocks
from bodycam_ros.ingest.offset_search import OffsetCurve, Pair, agreed_offsets
from bodycam_ros.ingest.sound_envelope import ENVELOPE_S, CameraSound
from bodycam_ros.progress import Progress

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

_DISTANCE_SIGMA_M = 0.3  # spread of the distances from a clap to the cameras of a body
_SOUND_SPEED = 343.0  # of air at 20 degrees [m/s]; at -10 degrees 325


def sound_times(
    sounds: Mapping[str, CameraSound],
    reference: str,
    progress: Progress,
) -> FoundTimes:
    """Clocks of cameras by sound, in the time of one of them; those that it cannot place are not in it.

    Args:
        sounds: camera -> its sound.
        reference: camera whose time is the recording's, if it can be placed; else the one with most evidence.
        progress: of the pairs.
    """
    curves: dict[Pair, OffsetCurve] = {}
    pairs = list(combinations(sounds, 2))
    with progress.step("comparing sounds", len(pairs)) as advance:
        for first, second in pairs:
            curve = _envelope_curve(sounds[first], sounds[second])
            if curve is not None:
                curves[first, second] = curve
            advance()
    if not curves:
        return FoundTimes("sound", {})
    evidence = {name: sum(float(c.values.max()) for pair, c in curves.items() if name in pair) for name in sounds}
    root = max(evidence, key=lambda name: evidence[name])
    agreed = agreed_offsets(root, curves, apart=round(_APART_S / _COARSE_S))
    placed = [name for name in sounds if name in agreed and agreed[name].confidence >= _MIN_CONFIDENCE]
    if root not in placed or len(placed) < 2:
        return FoundTimes("sound", {})
    # Offsets are between the beginnings of sounds.
    starts = {name: _COARSE_S * agreed[name].samples - sounds[name].start_s for name in placed}
    records = []
    for pair in combinations(range(len(placed)), 2):
        one, other = (placed[row] for row in pair)
        for media_s in _window_times(sounds[one], sounds[other], starts[other] - starts[one]):
            sigma_s = _WINDOW_SIGMA_S / np.sqrt(2.0)
            records.append([(row, seconds, sigma_s) for row, seconds in zip(pair, media_s, strict=True)])
    floor_s = np.hypot(np.sqrt(2.0) * _DISTANCE_SIGMA_M / _SOUND_SPEED, 0.5 * _WINDOW_SIGMA_S)
    reference = reference if reference in placed else root
    times = fit_clocks(placed, records, reference, "sound", float(floor_s))
    return FoundTimes(
        "sound", {name: replace(time, confidence=agreed[name].confidence) for name, time in times.items()}
    )


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
        values = correlate(other, part, method="fft")
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


def _window_times(first: CameraSound, second: CameraSound, offset_s: float) -> list[tuple[float, float]]:
    """Media times of the two cameras [s] at the middle of windows in which their envelopes agree clearly.

    Args:
        first, second: the sounds.
        offset_s: start of the second less that of the first, to some hundredths [s].
    """
    one, other = _levelled(first.envelope), _levelled(second.envelope)
    lag = round((first.start_s - second.start_s - offset_s) / ENVELOPE_S)
    begin, end = max(0, -lag), min(len(one), len(other) - lag)
    window = int(min(_WINDOW_S / ENVELOPE_S, end - begin))
    reach = int((_NEAR_S + _LARGEST_DRIFT * ENVELOPE_S * max(len(one), len(other))) / ENVELOPE_S)
    if window <= reach:
        return []
    times = []
    count = min(_MOST_WINDOWS, -(-(end - begin) // window))
    for start in np.linspace(begin, end - window, count).astype(int):
        part = one[start : start + window]
        low, high = max(0, start + lag - reach), min(len(other), start + lag + window + reach)
        candidates = np.arange(start + lag - reach - low, start + lag + reach - low + 1)
        near = correlate(other[low:high], part, method="fft")[len(part) - 1 + candidates]
        best = int(np.argmax(near))
        chance = float(np.linalg.norm(part)) * float(other[low:high].std())
        if not 0 < best < len(near) - 1 or near[best] < _WINDOW_STRENGTH * chance:
            continue
        bend = near[best - 1] - 2.0 * near[best] + near[best + 1]
        fraction = 0.5 * (near[best - 1] - near[best + 1]) / bend if bend < 0.0 else 0.0
        centre = start + float(np.average(np.arange(window), weights=np.maximum(part, 0.0) + 1e-12))
        there = centre - start + low + candidates[best] + fraction
        times.append((first.start_s + ENVELOPE_S * centre, second.start_s + ENVELOPE_S * float(there)))
    return times
