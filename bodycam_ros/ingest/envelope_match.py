"""By how much two sounds as a whole are shifted: where the loudness of both rises at the same times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, CameraSound

Array = NDArray[np.float64]

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
