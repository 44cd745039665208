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

from bodycam_ros.ingest.clock_fit import CameraTime, Reading, fit_clocks
from bodycam_ros.ingest.offset_search import MIN_OVERLAP_S, OffsetCurve, Signal, agreed_offsets, offset_curves
from bodycam_ros.ingest.sound_envelope import ENVELOPE_S, CameraSound
from bodycam_ros.progress import Progress

Array = NDArray[np.float64]

_COARSE = 5  # steps of the envelope that make one of the search
_RATE_HZ = 1.0 / (_COARSE * ENVELOPE_S)
_MAX_OFFSET_S = 1800.0
_MIN_EVIDENCE = 64.0  # of a pair; minutes of unlike noise reach 54
_MIN_CONFIDENCE = 0.15  # lead over the second best offset
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
) -> dict[str, CameraTime]:
    """Clocks of cameras by sound, in the time of one of them; those that it cannot place are not in it.

    Args:
        sounds: camera -> its sound.
        reference: camera whose time is the recording's, if it can be placed; else the one with most evidence.
        progress: of the pairs.
    """
    signals = {name: _signal(sound) for name, sound in sounds.items() if sound.duration_s >= MIN_OVERLAP_S}
    pairs = list(combinations(signals, 2))
    with progress.step("comparing sounds", len(pairs)) as advance:
        curves = offset_curves(signals, pairs, _RATE_HZ, _MAX_OFFSET_S, advance)
    curves = {
        pair: _near_ends(curve, *(signals[name] for name in pair))
        for pair, curve in curves.items()
        if curve.values.max() >= _MIN_EVIDENCE
    }
    if not curves:
        return {}
    evidence = {name: sum(c.values.max() for pair, c in curves.items() if name in pair) for name in signals}
    root = max(evidence, key=lambda name: evidence[name])
    agreed = agreed_offsets(root, curves, _RATE_HZ)
    placed = {name: each for name, each in agreed.items() if each.confidence >= _MIN_CONFIDENCE}
    readings: list[Reading] = []
    for pair in combinations(placed, 2):
        one, other = (sounds[name] for name in pair)
        offset_s = (placed[pair[1]].samples - placed[pair[0]].samples) / _RATE_HZ
        readings += [(pair, media_s) for media_s in _window_times(one, other, offset_s)]
    if not readings:
        return {}
    floor_s = np.hypot(np.sqrt(2.0) * _DISTANCE_SIGMA_M / _SOUND_SPEED, 0.5 * _WINDOW_SIGMA_S)
    times = fit_clocks(readings, reference if reference in placed else root, _WINDOW_SIGMA_S, float(floor_s))
    return {name: replace(time, source="sound", confidence=placed[name].confidence) for name, time in times.items()}


def _signal(sound: CameraSound) -> Signal:
    """The envelope at the steps of the search."""
    coarse = _levelled(sound.envelope)[: len(sound.envelope) // _COARSE * _COARSE].reshape(-1, _COARSE).sum(axis=1)
    return Signal(round(sound.start_s * _RATE_HZ), coarse[:, None], coarse)


def _near_ends(curve: OffsetCurve, first: Signal, second: Signal) -> OffsetCurve:
    """More evidence where both begin or end at about the same time: of two claps one camera may have but one."""
    starts = curve.lowest + np.arange(len(curve.values)) + second.first - first.first
    gap_s = np.minimum(np.abs(starts), np.abs(starts + len(second.values) - len(first.values))) / _RATE_HZ
    return replace(curve, values=curve.values * (1.0 + np.exp(-gap_s / _NEAR_ENDS_S)))


def _levelled(envelope: NDArray[np.float16]) -> Array:
    """Large rises count less than in proportion, so that one clap is not all."""
    return np.sqrt(np.maximum(envelope.astype(np.float64), 0.0))


def _window_times(first: CameraSound, second: CameraSound, offset_s: float) -> list[tuple[float, float]]:
    """Media times of the two cameras [s] at the middle of windows in which their envelopes agree clearly.

    Args:
        first, second: the sounds.
        offset_s: start of the second less that of the first, to some hundredths [s].
    """
    one, other = (values - values.mean() for values in map(_levelled, (first.envelope, second.envelope)))
    lag = round((first.start_s - second.start_s - offset_s) / ENVELOPE_S)
    begin, end = max(0, -lag), min(len(one), len(other) - lag)
    window = int(min(_WINDOW_S / ENVELOPE_S, end - begin))
    reach = int((_NEAR_S + _LARGEST_DRIFT * ENVELOPE_S * max(len(one), len(other))) / ENVELOPE_S)
    if window <= reach:
        return []
    times, padded = [], np.pad(other, reach)
    count = min(_MOST_WINDOWS, -(-(end - begin) // window))
    for start in np.linspace(begin, end - window, count).astype(int):
        part = one[start : start + window]
        around = padded[start + lag : start + lag + window + 2 * reach]
        near = correlate(around, part, mode="valid", method="fft")
        best = int(np.argmax(near))
        chance = float(np.linalg.norm(part)) * float(around.std())
        if not 0 < best < len(near) - 1 or near[best] < _WINDOW_STRENGTH * chance:
            continue
        bend = near[best - 1] - 2.0 * near[best] + near[best + 1]
        fraction = 0.5 * (near[best - 1] - near[best + 1]) / bend if bend < 0.0 else 0.0
        centre = start + float(np.average(np.arange(window), weights=np.maximum(part, 0.0) + 1e-12))
        there = centre + lag + best - reach + fraction
        times.append((first.start_s + ENVELOPE_S * centre, second.start_s + ENVELOPE_S * float(there)))
    return times
