"""When another system's recording began by our clock, and how fast its clock goes.

Two systems that see the same body agree on what no frame of reference changes: distances between points, how fast
points move, how fast bones turn. By these the offset is found among all that let the two overlap; then offset and rate
are fitted together with the alignment in space.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bodycam_ros.geometry import Array

RATES = (1.0, 1000.0 / 1001.0, 1.001, 0.997, 1.003, 0.99, 1.01, 24.0 / 25.0, 25.0 / 24.0)
"""Clocks that are tried: true ones, television's, crystals of little worth, films at another rate."""

_STEP_S = 0.02
_LEAST_OVERLAP_S, _LEAST_OVERLAP = 1.0, 0.5
"""Of the shorter recording: less may agree by chance."""

_LEAST_LIKENESS = 0.5
_APART_S = 0.5
"""Offsets farther from the best than this are other matches, not the same one."""

_CLEARLY = 0.02  # by which a clock that goes at another rate is more like: in a short recording nearly any is as good
_LEAD_BY_CHANCE = 0.4  # mean lead of unrelated motions
_LARGEST = 1.0 - 1e-6  # correlation that Fisher's transform is taken of
_LEAST_SPREAD = 0.05  # of chance: a short recording has too few other offsets to measure less
_ROBUST_M = 0.02
_FIT_S, _FIT_RATE = 0.5, 0.02  # how far the fit may go from what was found
_WITHIN = 2.0  # sigmas: a rate that differs from 1 by less is none
_SCALES = np.array([1e-2, 1e-3])  # [s] and rate: what the fit takes for small


@dataclass(frozen=True)
class Clock:
    """Time of ours [s] = ``start_s`` + ``rate`` times the time since the other's first frame [s].

    Attributes:
        start_s: when the other's recording began, since the start of ours [s].
        rate: seconds of ours in one of the other's.
        start_sigma_s: standard deviation of ``start_s``, 0 where the clock was given.
        rate_sigma: of ``rate``.
        likeness: mean correlation of what no frame of reference changes; NaN where it is unknown.
        lead: of the likeness over that at the second best offset, both by Fisher's transform, in standard deviations
            over all other offsets: what two motions reach by chance. Of n independent offsets the lead is then
            exponentially distributed with the mean 1 / sqrt(2 ln n), 0.4 and less. Negative where
            another offset is better than the clock that was given.
        chance: how probable it is that two unrelated motions agree as well: of a clock that was found, by its lead; of
            one that was given, the share of other offsets at which these two agree as well. NaN where the recordings
            are too short to measure it.
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


Transformed = NDArray[np.complex128]

Signals = Callable[[Array], Array]
"""Times (N,) [s] -> (F, N) what no frame of reference changes; NaN where it is not known."""


def found_clock(ours: Signals, ours_span: tuple[float, float], theirs: Signals, theirs_s: float) -> Clock | None:
    """The clock by which signals agree best, to some hundredths of a second; None if at no offset they agree.

    Args:
        ours: of our recording.
        ours_span: first and last time [s] that it has.
        theirs: of the other, by times since its first frame.
        theirs_s: how long it is [s].
    """
    times = np.arange(ours_span[0], ours_span[1], _STEP_S)
    of_ours = ours(times)
    best: Clock | None = None
    for rate in RATES:
        if rate != 1.0 and abs(rate - 1.0) * theirs_s < _STEP_S:
            continue
        count = int(rate * theirs_s / _STEP_S) + 1
        likeness = _likeness(of_ours, theirs(np.linspace(0.0, (count - 1) * _STEP_S / rate, count)))
        if likeness is None:
            continue
        at, value, lead = likeness
        if best is None or value > best.likeness + _CLEARLY:
            best = Clock(ours_span[0] + at * _STEP_S, rate, likeness=value, lead=lead, chance=_chance_of(lead))
    return best if best is not None and best.likeness >= _LEAST_LIKENESS else None


def rate_clock(clock: Clock, ours: Signals, ours_span: tuple[float, float], theirs: Signals, theirs_s: float) -> Clock:
    """A clock that was given, with the likeness of the motions by it and the chance of such a match.

    Args:
        clock: to rate.
        ours: of our recording.
        ours_span: first and last time [s] that it has.
        theirs: of the other, by times since its first frame.
        theirs_s: how long it is [s].
    """
    count = int(clock.rate * theirs_s / _STEP_S) + 1
    sampled = theirs(np.linspace(0.0, (count - 1) * _STEP_S / clock.rate, count))
    mean, enough = _correlations(ours(np.arange(ours_span[0], ours_span[1], _STEP_S)), sampled)
    shift = round((clock.start_s - ours_span[0]) / _STEP_S) + count - 1
    if not 0 <= shift < len(mean) or not enough[shift]:
        return clock
    # The given start lies between two shifts.
    at = shift + int(np.argmax(mean[max(shift - 1, 0) : shift + 2])) - min(shift, 1)
    others = enough & (np.abs(np.arange(len(mean)) - at) > _APART_S / _STEP_S)
    chance = float(np.mean(mean[others] >= mean[at])) if others.any() else np.nan
    return replace(clock, likeness=float(mean[at]), lead=_lead(mean, enough, at), chance=chance)


def _chance_of(lead: float) -> float:
    """How probable a lead is between unrelated motions, at the best of all rates."""
    return float(np.minimum(1.0, len(RATES) * np.exp(-lead / _LEAD_BY_CHANCE)))


def _likeness(a: Array, b: Array) -> tuple[int, float, float] | None:
    """The shift of b (F, M) in a (F, N) with the greatest mean correlation, that, and its lead; NaN counts nowhere."""
    mean, enough = _correlations(a, b)
    if not enough.any():
        return None
    at = int(np.argmax(mean))
    return at - (b.shape[1] - 1), float(mean[at]), _lead(mean, enough, at)


def _correlations(a: Array, b: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Mean correlation (S,) of b (F, M) with a (F, N) at all shifts, and whether enough overlaps there.

    Sums over what overlaps, at all shifts at once, are convolutions.
    """
    size = a.shape[1] + b.shape[1] - 1
    transformed = [
        (np.fft.rfft(v, size, axis=1), np.fft.rfft(v * v, size, axis=1), np.fft.rfft(m, size, axis=1))
        for v, m in ((_standard(a), np.isfinite(a)), (_standard(b)[:, ::-1], np.isfinite(b)[:, ::-1]))
    ]
    (A, AA, MA), (B, BB, MB) = transformed

    def over(x: Transformed, y: Transformed) -> Array:
        return np.fft.irfft(x * y, size, axis=1)

    n = np.maximum(np.rint(over(MA, MB)), 1e-9)
    sa, sb, saa, sbb, sab = over(A, MB), over(MA, B), over(AA, MB), over(MA, BB), over(A, B)
    spread = np.sqrt(np.maximum(n * saa - sa**2, 0.0) * np.maximum(n * sbb - sb**2, 0.0))
    least = max(_LEAST_OVERLAP_S / _STEP_S, _LEAST_OVERLAP * min(a.shape[1], b.shape[1]))
    counts = (n >= least) & (spread > 1e-3 * n**2)
    correlation = np.where(counts, (n * sab - sa * sb) / np.maximum(spread, 1e-12), np.nan)
    enough = counts.sum(axis=0) >= max(1, int(counts.any(axis=1).sum() * 0.5))
    total = np.nansum(np.where(counts, correlation, 0.0), axis=0)
    return np.where(enough, total / np.maximum(counts.sum(axis=0), 1), -1.0), enough


def _lead(mean: Array, enough: NDArray[np.bool_], at: int) -> float:
    """Lead of the mean correlation (S,) at a shift over all others that have enough; NaN where there are none."""
    others = enough & (np.abs(np.arange(len(mean)) - at) > _APART_S / _STEP_S)
    if not others.any():
        return np.nan
    fisher = np.arctanh(np.clip(mean, -_LARGEST, _LARGEST))
    return float((fisher[at] - fisher[others].max()) / max(fisher[others].std(), _LEAST_SPREAD))


def _standard(values: Array) -> Array:
    """Values (F, N) with mean 0 and spread 1 in each row, 0 where they are not known."""
    known = np.isfinite(values)
    count = np.maximum(known.sum(axis=1, keepdims=True), 1)
    centred = np.where(known, values, 0.0)
    centred = np.where(known, centred - centred.sum(axis=1, keepdims=True) / count, 0.0)
    spread = np.sqrt((centred**2).sum(axis=1, keepdims=True) / count)
    standard: Array = centred / np.maximum(spread, 1e-9)
    return standard


def fitted_clock(start: Clock, residuals: Callable[[Clock], Array], with_rate: bool = True) -> Clock:
    """Offset and rate that make residuals least, from a clock that is found.

    Errors of neighbours in time are alike, so sigmas are made larger by what the residuals' correlation tells. A rate
    that differs from 1 by less than two sigmas is none: then the offset is fitted alone.

    Args:
        start: to begin from.
        residuals: clock -> (T, N, 3) [m] after the best alignment in space; 0 where nothing is known.
        with_rate: fit the rate, too.
    """

    def clock(x: Array) -> Clock:
        rate = start.rate + x[1] if with_rate else 1.0
        return replace(start, start_s=start.start_s + float(x[0]), rate=float(rate))

    count = 2 if with_rate else 1
    bounds = np.array([_FIT_S, _FIT_RATE])[:count]
    fit = least_squares(
        lambda x: residuals(clock(x)).ravel(), np.zeros(count), bounds=(-bounds, bounds), loss="soft_l1",
        f_scale=_ROBUST_M, x_scale=_SCALES[:count], max_nfev=40,
    )  # fmt: skip
    found = clock(fit.x)
    sigmas = _sigmas(np.asarray(fit.jac), residuals(found))
    if with_rate and abs(found.rate - 1.0) < _WITHIN * sigmas[1]:
        return fitted_clock(replace(found, rate=1.0), residuals, with_rate=False)
    return replace(found, start_sigma_s=float(sigmas[0]), rate_sigma=float(sigmas[1]) if with_rate else 0.0)


def _sigmas(jacobian: Array, residuals: Array) -> Array:
    """Standard deviations of what was fitted, with errors that are alike from instant to instant."""
    rows = residuals.reshape(len(residuals), -1)
    power = float((rows**2).sum())
    alike = float((rows[1:] * rows[:-1]).sum()) / max(power, 1e-30) if len(rows) > 1 else 0.0
    alike = min(max(alike, 0.0), 0.99)
    variance = power / max(int((rows != 0.0).sum()), 1) * (1.0 + alike) / (1.0 - alike)
    sigmas: Array = np.sqrt(np.maximum(np.diag(np.linalg.pinv(jacobian.T @ jacobian)), 0.0) * variance)
    return sigmas


def unit_found(ours: Mapping[str, Array], theirs: Mapping[str, Array]) -> float:
    """Metres in the unit that another system's places are in, told by distances between points that both have.

    Args:
        ours: name -> (T, 3) [m].
        theirs: name -> (K, 3), at other times, in its unit.
    """
    names = [name for name in ours if name in theirs]
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    ratios = [
        _distance(ours[a], ours[b]) / distance for a, b in pairs if (distance := _distance(theirs[a], theirs[b])) > 0.0
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    return min(UNITS, key=lambda metres: abs(np.log(ratio / metres)))


UNITS = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)
"""Metres, centimetres, millimetres, inches, and the unit of the motions of Carnegie Mellon University."""


def _distance(a: Array, b: Array) -> float:
    return float(np.nanmedian(np.linalg.norm(a - b, axis=1)))
