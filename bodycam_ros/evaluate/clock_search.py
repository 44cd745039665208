"""Clock of another system by motion: the offset and rate at which two recordings show the same motion.

Distances between points and speeds of points do not depend on the frame of reference. Their mean correlation is the
score of an offset, computed at all offsets at once. Offset and rate are then refined together with the alignment in
space.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import fftconvolve

from bodycam_ros.geometry import Array

RATES = (1.0, 1000.0 / 1001.0, 1.001, 0.997, 1.003, 0.99, 1.01, 24.0 / 25.0, 25.0 / 24.0)
"""Rates that are tried: true clocks, television's, poor crystals, films at another rate."""

_STEP_S = 0.02  # between offsets
_MIN_OVERLAP_S, _MIN_OVERLAP = 1.0, 0.5  # the second as a share of the shorter recording: less agrees by chance
_MIN_LIKENESS = 0.5
_APART_S = 0.5  # offsets farther from the best than this are other matches
_CLEARLY = 0.02  # by which another rate has to correlate better: in a short recording nearly any rate is as good
_LEAD_BY_CHANCE = 0.4  # mean lead of unrelated motions
_MAX_CORRELATION = 1.0 - 1e-6  # that Fisher's transform is taken of
_MIN_SPREAD = 0.05  # of Fisher's transform over other offsets: a short recording has too few of them to measure it
_ROBUST_M = 0.02
_FIT_BOUNDS = np.array([0.5, 0.02])  # [s] and rate: how far the fit may leave the initial estimate
_FIT_SCALES = np.array([1e-2, 1e-3])  # [s] and rate: small steps of the fit
_MIN_RATE_SIGMAS = 2.0  # a rate closer to 1 than this is 1


@dataclass(frozen=True)
class Clock:
    """Time of ours [s] = ``start_s`` + ``rate`` times the time since the other's first frame [s].

    Attributes:
        start_s: start of the other's recording, since the start of ours [s].
        rate: seconds of ours in one of the other's.
        start_sigma_s: standard deviation of ``start_s``, 0 where the clock was given.
        rate_sigma: of ``rate``.
        likeness: mean correlation of the signals; NaN where it is unknown.
        lead: of the likeness over that at the second best offset, both by Fisher's transform, in standard deviations
            over all other offsets. Of n independent offsets of unrelated motions the lead is exponentially distributed
            with the mean 1 / sqrt(2 ln n), 0.4 and less. Negative where another offset is better than a given clock.
        chance: probability that two unrelated motions agree as well: of a clock that was found, by its lead; of a given
            one, the share of other offsets at which these two agree as well. NaN where recordings are too short.
    """

    start_s: float
    rate: float = 1.0
    start_sigma_s: float = 0.0
    rate_sigma: float = 0.0
    likeness: float = np.nan
    lead: float = np.nan
    chance: float = np.nan

    def theirs(self, ours_s: Array) -> Array:
        """Times (N,) since the start of our recording [s], as times since the other's first frame [s]."""
        return (ours_s - self.start_s) / self.rate


Signals = Callable[[Array], Array]
"""Times (N,) [s] -> (F, N) values that do not depend on the frame of reference; NaN where unknown."""


def find_clock(ours: Signals, ours_span: tuple[float, float], theirs: Signals, theirs_s: float) -> Clock | None:
    """Search for the clock at which signals correlate best, to some hundredths of a second; None if they never do.

    Args:
        ours: of our recording.
        ours_span: first and last time [s] of it.
        theirs: of the other, by times since its first frame.
        theirs_s: duration of it [s].
    """
    sampled = ours(np.arange(*ours_span, _STEP_S))
    best: Clock | None = None
    for rate in RATES:
        if rate != 1.0 and abs(rate - 1.0) * theirs_s < _STEP_S:
            continue
        scores, zero = _score_offsets(sampled, theirs, theirs_s, rate)
        row = int(np.argmax(scores))
        if scores[row] > (-1.0 if best is None else best.likeness + _CLEARLY):
            lead, _ = _compare_with_others(scores, row)
            chance = float(np.minimum(1.0, len(RATES) * np.exp(-lead / _LEAD_BY_CHANCE)))
            best = Clock(ours_span[0] + (row - zero) * _STEP_S, rate, 0.0, 0.0, float(scores[row]), lead, chance)
    return best if best is not None and best.likeness >= _MIN_LIKENESS else None


def rate_clock(clock: Clock, ours: Signals, ours_span: tuple[float, float], theirs: Signals, theirs_s: float) -> Clock:
    """A given clock with likeness, lead and chance; without them where the recordings overlap too little.

    Args: as of ``find_clock``.
    """
    scores, zero = _score_offsets(ours(np.arange(*ours_span, _STEP_S)), theirs, theirs_s, clock.rate)
    row = round((clock.start_s - ours_span[0]) / _STEP_S) + zero
    if not 0 <= row < len(scores) or scores[row] == -1.0:
        return clock
    first = max(row - 1, 0)  # the given start lies between two offsets
    row = first + int(np.argmax(scores[first : row + 2]))
    lead, chance = _compare_with_others(scores, row)
    return replace(clock, likeness=float(scores[row]), lead=lead, chance=chance)


def _compare_with_others(scores: Array, row: int) -> tuple[float, float]:
    """Lead of an offset over all other matches (``Clock.lead``), and the share of these that are as good; NaN without.

    Args:
        scores: (S,) of ``_score_offsets``.
        row: of the offset.
    """
    others = (scores > -1.0) & (np.abs(np.arange(len(scores)) - row) > _APART_S / _STEP_S)
    if not others.any():
        return np.nan, np.nan
    fisher = np.arctanh(np.clip(scores, -_MAX_CORRELATION, _MAX_CORRELATION))
    lead = float((fisher[row] - fisher[others].max()) / max(fisher[others].std(), _MIN_SPREAD))
    return lead, float(np.mean(scores[others] >= scores[row]))


def _score_offsets(ours: Array, theirs: Signals, theirs_s: float, rate: float) -> tuple[Array, int]:
    """Correlate our samples (F, N) with theirs, resampled by a rate, at all offsets.

    Returns:
        (S,) mean correlation, -1 with too little overlap; and the row at which both recordings start together.
    """
    count = int(rate * theirs_s / _STEP_S) + 1
    sampled = theirs(np.linspace(0.0, (count - 1) * _STEP_S / rate, count))
    a, known_a = _standardise(ours)
    b, known_b = (values[:, ::-1] for values in _standardise(sampled))
    # The sums over what overlaps are convolutions.
    n, sum_a, sum_b, sum_aa, sum_bb, sum_ab = (
        fftconvolve(x, y, axes=1)
        for x, y in ((known_a, known_b), (a, known_b), (known_a, b), (a * a, known_b), (known_a, b * b), (a, b))
    )
    n = np.maximum(np.rint(n), 1e-9)
    spread = np.sqrt(np.maximum(n * sum_aa - sum_a**2, 0.0) * np.maximum(n * sum_bb - sum_b**2, 0.0))
    min_count = max(_MIN_OVERLAP_S / _STEP_S, _MIN_OVERLAP * min(a.shape[1], count))
    counts = (n >= min_count) & (spread > 1e-3 * n**2)
    correlation = np.where(counts, (n * sum_ab - sum_a * sum_b) / np.maximum(spread, 1e-12), 0.0)
    overlaps = counts.sum(axis=0) >= max(1, int(counts.any(axis=1).sum() * 0.5))
    mean = correlation.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    return np.where(overlaps, mean, -1.0), count - 1


def _standardise(values: Array) -> tuple[Array, Array]:
    """Values (F, N) with mean 0 and spread 1 in each row, 0 where unknown; and 1 where known, else 0."""
    known = np.isfinite(values)
    masked = np.ma.array(values, mask=~known)
    centred = masked - masked.mean(axis=1, keepdims=True)
    standard = centred / np.ma.maximum(centred.std(axis=1, keepdims=True), 1e-9)
    return np.asarray(standard.filled(0.0)), known.astype(np.float64)


def fit_clock(initial: Clock, residuals: Callable[[Clock], Array], with_rate: bool = True) -> Clock:
    """Refine offset and rate by least squares.

    Errors are correlated in time, so standard deviations are enlarged by the residuals' correlation. A rate within two
    standard deviations of 1 is 1; then the offset is fitted alone.

    Args:
        initial: estimate.
        residuals: clock -> (T, N, 3) [m] after the best alignment in space; 0 where unknown.
        with_rate: fit the rate, too.
    """

    def clock(x: Array) -> Clock:
        rate = float(initial.rate + x[1]) if with_rate else 1.0
        return replace(initial, start_s=initial.start_s + float(x[0]), rate=rate)

    count = 2 if with_rate else 1
    bounds = _FIT_BOUNDS[:count]
    fit = least_squares(
        lambda x: residuals(clock(x)).ravel(), np.zeros(count), bounds=(-bounds, bounds), loss="soft_l1",
        f_scale=_ROBUST_M, x_scale=_FIT_SCALES[:count], max_nfev=40,
    )  # fmt: skip
    found = clock(fit.x)
    sigmas = _sigmas(np.asarray(fit.jac), residuals(found))
    if with_rate and abs(found.rate - 1.0) < _MIN_RATE_SIGMAS * sigmas[1]:
        return fit_clock(replace(found, rate=1.0), residuals, with_rate=False)
    return replace(found, start_sigma_s=float(sigmas[0]), rate_sigma=float(sigmas[1]) if with_rate else 0.0)


def _sigmas(jacobian: Array, residuals: Array) -> Array:
    """Standard deviations of what was fitted, with errors that are correlated from frame to frame."""
    rows = residuals.reshape(len(residuals), -1)
    power = float((rows**2).sum())
    correlation = float((rows[1:] * rows[:-1]).sum()) / max(power, 1e-30) if len(rows) > 1 else 0.0
    correlation = min(max(correlation, 0.0), 0.99)
    variance = power / max(int(np.count_nonzero(rows)), 1) * (1.0 + correlation) / (1.0 - correlation)
    sigmas: Array = np.sqrt(np.maximum(np.diag(np.linalg.pinv(jacobian.T @ jacobian)), 0.0) * variance)
    return sigmas
