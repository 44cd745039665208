"""Time differences of one sound between cameras, by correlation of the waveforms.

AAC smears the beginning of a clap over some milliseconds; the correlation is good to some hundredths of that.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bodycam_ros.ingest.sound_peaks import SNIPPET_S, SNIPPET_SAMPLES, SoundPeak

Array = NDArray[np.float64]

_LARGEST_LAG_S = 0.012  # between snippets: travel over 2 m, and a beginning wrong by some milliseconds on either side
_ONSET_SIGMA_S = 0.0015  # of a beginning by its rise in loudness alone
_LIKE = 0.35  # correlation below which waveforms may agree anywhere: a clap and a bump reach 0.32, one clap mostly 0.78
_PAIR_SIGMA_S = 5e-5
_BEGUN = 0.3  # of the largest value; what AAC smears ahead is below
_AHEAD_S = 0.006  # AAC smears a beginning by less
_STRAIGHT_S = 0.004  # by which what counts dies away: a reflection from the floor comes 3 to 6 ms later
_PADDED = 2 * SNIPPET_SAMPLES
_FINER = 8
_STEP_S = SNIPPET_S / SNIPPET_SAMPLES
_LAGS = int(_LARGEST_LAG_S / _STEP_S * _FINER)


def _spectrum(peak: SoundPeak) -> NDArray[np.complex128]:
    """Spectrum of the beginning of a peak's snippet, of norm 1; zero for a silent one."""
    waveform = peak.snippet.astype(float)
    waveform = waveform - waveform.mean()
    # What comes first came straight; floor and walls follow some milliseconds later, and by other ways to each camera.
    after = np.arange(SNIPPET_SAMPLES) * _STEP_S - _beginning(peak)
    waveform *= np.where(after < 0.0, np.clip(1.0 + after / _AHEAD_S, 0.0, 1.0), np.exp(-after / _STRAIGHT_S))
    norm = float(np.linalg.norm(waveform))
    transformed: NDArray[np.complex128] = np.fft.rfft(waveform / norm if norm > 0.0 else waveform, _PADDED)
    return transformed


def _likeness(first: NDArray[np.complex128], second: NDArray[np.complex128]) -> tuple[float, float]:
    """(correlation at best, 0 to 1; by how much the first snippet's sound lies later in it than the second's [s])."""
    product = np.zeros(_FINER * _PADDED // 2 + 1, dtype=complex)
    product[: _PADDED // 2 + 1] = first * np.conj(second)
    correlation = np.fft.irfft(product) * _FINER
    near = np.concatenate((correlation[-_LAGS:], correlation[: _LAGS + 1]))
    best = int(np.argmax(near))
    lag = float(best - _LAGS)
    if 0 < best < len(near) - 1:
        before, at, after = near[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        lag += 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return max(0.0, float(near[best])), lag * _STEP_S / _FINER


def arrivals(peaks: Sequence[SoundPeak]) -> tuple[Array, Array]:
    """Media times (N,) [s] at which one sound reached N cameras, and their standard deviations (N,) [s].

    Only differences between cameras count; the error that they have in common is that of a beginning.
    """
    rough = np.array([peak.media_s for peak in peaks])
    starts = np.array([peak.snippet_s for peak in peaks])
    spectra = [_spectrum(peak) for peak in peaks]
    pairs, gaps, likes = [], [], []
    for first, second in combinations(range(len(peaks)), 2):
        like, lag = _likeness(spectra[first], spectra[second])
        if like >= _LIKE:
            pairs.append((first, second))
            gaps.append(lag + (starts[first] - rough[first]) - (starts[second] - rough[second]))
            likes.append(like)
    if not pairs:
        return rough, np.full(len(peaks), _ONSET_SIGMA_S)
    one, other = np.array(pairs).T

    def residuals(shift: Array) -> Array:
        errors = np.array(likes) * (shift[one] - shift[other] - np.array(gaps)) / _PAIR_SIGMA_S
        return np.concatenate((errors, shift / _ONSET_SIGMA_S))

    shift = least_squares(residuals, np.zeros(len(peaks)), loss="soft_l1").x
    agree = np.abs(shift[one] - shift[other] - np.array(gaps)) < 4.0 * _PAIR_SIGMA_S
    counts = np.bincount(np.concatenate((one[agree], other[agree])), minlength=len(peaks))
    sigma = np.where(counts > 0, _PAIR_SIGMA_S / np.sqrt(np.maximum(counts, 1)), _ONSET_SIGMA_S)
    begins = [start + _beginning(peak) for start, peak in zip(starts, peaks, strict=True)]
    return rough + shift + float(np.median(np.array(begins) - rough - shift)), sigma


def _beginning(peak: SoundPeak) -> float:
    """Where in its snippet a sound begins [s]; within some milliseconds, as AAC smears it."""
    loudness = np.abs(peak.snippet.astype(float))
    return float(np.argmax(loudness >= _BEGUN * loudness.max())) * _STEP_S
