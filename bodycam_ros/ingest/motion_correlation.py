"""Correlation of the motions of two cameras at every offset of their clocks.

Compared are the angular velocity and its norm, each brought to the same strength within a quarter of a second: limbs
swing with sizes that differ by magnitudes, but they start and stop together. The measure is the mutual information of
two Gaussian variables (-1/2 log det(1 - squared canonical correlations)): it needs neither the mounts nor that all
axes of a limb follow its neighbour's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from bodycam_ros.ingest.offset_search import OffsetCurve
from bodycam_ros.tracking.angular_speed import AngularSpeed

Array = NDArray[np.float64]

SEARCH_RATE = 60
"""Samples per second of the comparison [1/s]; twice what most cameras take."""

_STRENGTH_S = 0.25  # over which the strength is evened out
_STILL = 0.1  # [rad/s] below it a motion is not amplified: it is the noise of the images
_REGULAR = 1e-4  # of the largest variance, so that a motion about one axis can be inverted


@dataclass(frozen=True, eq=False)
class EvenMotion:
    """A camera's motion, evenly sampled and of even strength.

    Attributes:
        first: media time of the first sample, in samples.
        values: (N, 4) three components and their norm.
    """

    first: int
    values: Array


def even_motion(speed: AngularSpeed, begin_s: float, end_s: float) -> EvenMotion | None:
    """A camera's motion between two media times [s]; None where it is known for less than a second."""
    known = speed.known & (speed.media_s >= begin_s) & (speed.media_s <= end_s)
    times = speed.media_s[known]
    if len(times) < 8 or times[-1] - times[0] < 1.0:
        return None
    samples = np.arange(int(np.ceil(times[0] * SEARCH_RATE)), int(np.floor(times[-1] * SEARCH_RATE)) + 1)
    omega = speed.omega[known]
    measured = np.column_stack([omega, np.linalg.norm(omega, axis=1)])
    values = CubicSpline(times, measured)(samples / SEARCH_RATE)
    strength = gaussian_filter1d((values**2).sum(axis=1), _STRENGTH_S * SEARCH_RATE)
    return EvenMotion(int(samples[0]), values / np.sqrt(_STILL**2 + np.maximum(strength, 0.0))[:, None])


def offset_curve(
    first: EvenMotion, second: EvenMotion, min_overlap_s: float, max_offset_s: float
) -> OffsetCurve | None:
    """Evidence for every offset ``start_second - start_first``; None where the two never overlap for long enough.

    Args:
        first, second: the motions, each in media time of its camera.
        min_overlap_s: offsets that leave less than this in common are left out [s].
        max_offset_s: so are those beyond this [s].
    """
    x, y = first.values, second.values
    shifts = np.arange(-(len(y) - 1), len(x))
    offsets = shifts + first.first - second.first
    begin, end = np.maximum(0, shifts), np.minimum(len(x), len(y) + shifts)
    tried = (end - begin >= min_overlap_s * SEARCH_RATE) & (np.abs(offsets) <= max_offset_s * SEARCH_RATE)
    if tried.sum() < 2:
        return None
    shifts, offsets, begin, end = shifts[tried], offsets[tried], begin[tried], end[tried]
    common = (end - begin)[:, None, None].astype(np.float64)
    sum_xy = _lagged_products(x, y)[shifts]
    mean_x, mean_y = _sums(x, begin, end) / common[:, 0], _sums(y, begin - shifts, end - shifts) / common[:, 0]
    cov_xy = sum_xy / common - mean_x[:, :, None] * mean_y[:, None, :]
    cov_x = _covariances(x, begin, end, mean_x, common)
    cov_y = _covariances(y, begin - shifts, end - shifts, mean_y, common)
    shared = np.linalg.solve(cov_x, cov_xy) @ np.linalg.solve(cov_y, cov_xy.transpose(0, 2, 1))
    information = -0.5 * np.linalg.slogdet(np.eye(x.shape[1]) - shared)[1] * common[:, 0, 0]
    centred = information - np.median(information)
    spread = 1.4826 * float(np.median(np.abs(centred)))
    return OffsetCurve(int(offsets[0]), centred / max(spread, 1e-9))


def chance_curve(
    first: EvenMotion, second: EvenMotion, min_overlap_s: float, max_offset_s: float
) -> OffsetCurve | None:
    """Evidence that two such motions have by chance: the second's time is reversed, its rhythm is not.

    Its offsets are ``-start_second - start_first``.
    """
    curve = offset_curve(first, EvenMotion(second.first, second.values[::-1]), min_overlap_s, max_offset_s)
    return (
        None if curve is None else OffsetCurve(curve.lowest + 2 * second.first + len(second.values) - 1, curve.values)
    )


def _lagged_products(x: Array, y: Array) -> Array:
    """(P, 4, 4) sums over i of x[i] y[i - shift]; index it by the shift, negative ones from the end."""
    length = 1 << int(np.ceil(np.log2(len(x) + len(y))))
    spectrum = np.fft.rfft(x, length, axis=0)[:, :, None] * np.conj(np.fft.rfft(y, length, axis=0))[:, None, :]
    products: Array = np.fft.irfft(spectrum, length, axis=0)
    return products


def _sums(values: Array, begin: NDArray[np.int64], end: NDArray[np.int64]) -> Array:
    """Sums over rows from ``begin`` to before ``end``."""
    running = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    sums: Array = running[end] - running[begin]
    return sums


def _covariances(values: Array, begin: NDArray[np.int64], end: NDArray[np.int64], means: Array, common: Array) -> Array:
    squares = _sums(values[:, :, None] * values[:, None, :], begin, end) / common
    covariances = squares - means[:, :, None] * means[:, None, :]
    largest = np.trace(covariances, axis1=1, axis2=2).max()
    regular: Array = covariances + (_REGULAR * largest + 1e-9) * np.eye(values.shape[1])
    return regular
