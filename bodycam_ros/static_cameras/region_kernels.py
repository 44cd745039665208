"""Where regions of colour part along lines across a contour (B 2.4), and the normal equations of a segment's pose.

Along the normal of each contour point the colours of the image are more like the segment's or more like what is
beside it. Where the one gives way to the other is unknown by so many pixels; its distribution, for a smoothed step of
the colours' posterior (Tjaden et al. 2018; Stoiber et al. 2020, "A sparse Gaussian approach to region-based 6DoF
object tracking"), has a mean, which is where the contour should be, and a variance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel
from bodycam_ros.static_cameras.contour_kernels import is_beside, label_at

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Counts = NDArray[np.float32]

BINS = 16
"""Colours are told apart by so many steps of blue, green and red."""

COLOURS = BINS**3

_REACH = 6  # displacements that are considered to either side, in steps of a line
_STEP = 7  # samples to either side of a displacement that the smoothed step covers
_SLOPE, _WIDTH = 0.42, 1.0  # of the step: 0.5 - _SLOPE tanh(x / (2 _WIDTH)), x outward
_SURE = 12.0  # logarithm of odds that no pixel exceeds
_FLAT = 8.0  # [steps^2] variance of a line without evidence: all displacements alike have 14
_FAR = 3.0  # [steps] displacement from which a line counts less than half: it may be another person's contour
_GAP = 2  # [px] beside the contour that belong to neither, as it is not quite where it should be


@kernel()
def _colour(image: Bytes, x: float, y: float) -> int:
    """Bin of the pixel's colour; -1 outside of the image."""
    column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    if column < 0 or row < 0 or row >= image.shape[0] or column >= image.shape[1]:
        return -1
    step = 256 // BINS
    blue, green, red = image[row, column, 0] // step, image[row, column, 1] // step, image[row, column, 2] // step
    return (int(blue) * BINS + int(green)) * BINS + int(red)


@kernel("(u1[:, :, ::1], u1[:, ::1], i8, f8[:, ::1], i8[::1], u1[:, ::1], i8, i8)")
def count_colours(
    image: Bytes,
    labels: Bytes,
    shrink: int,
    points: Array,
    segments: Whole,
    stands_out: Bytes,
    inward: int,
    outward: int,
) -> tuple[Counts, Counts]:
    """How often each colour (S, COLOURS) lies inward, and outward, of the contours of segments.

    Args:
        image: (H, W, 3) blue, green, red.
        labels, shrink: which segment was in front where the contour was found, at a part of the resolution.
        points, segments: of ``find_contour``, or carried on from there.
        stands_out: (S, S) whether one segment differs from another that is behind it.
        inward, outward: [px] from the contour.
    """
    inside = np.zeros((len(stands_out), COLOURS), np.float32)
    outside = np.zeros((len(stands_out), COLOURS), np.float32)
    for n in range(len(points)):
        x, y, normal_x, normal_y = points[n, 0], points[n, 1], points[n, 2], points[n, 3]
        found_x, found_y = points[n, 10], points[n, 11]
        segment = segments[n]
        for step in range(_GAP, inward):
            colour = _colour(image, x - step * normal_x, y - step * normal_y)
            label = label_at(labels, found_x - step * normal_x, found_y - step * normal_y, shrink)
            if colour < 0 or label != segment:
                break
            inside[segment, colour] += 1.0
        for step in range(_GAP, outward):
            colour = _colour(image, x + step * normal_x, y + step * normal_y)
            label = label_at(labels, found_x + step * normal_x, found_y + step * normal_y, shrink)
            if colour < 0 or not is_beside(stands_out, segment, label):
                break
            outside[segment, colour] += 1.0
    return inside, outside


@kernel("(u1[:, :, ::1], u1[:, ::1], i8, f8[:, ::1], i8[::1], u1[:, ::1], f4[:, ::1], i8, f8)")
def measure_lines(
    image: Bytes,
    labels: Bytes,
    shrink: int,
    points: Array,
    segments: Whole,
    stands_out: Bytes,
    log_odds: NDArray[np.float32],
    stride: int,
    least_sigma_px: float,
) -> tuple[Array, Array, Whole, Array, Array]:
    """Measure the lines across the contours, and sum them up for their segments' poses.

    Args:
        image: (H, W, 3) blue, green, red.
        labels, shrink: which segment was in front where the contour was found, at a part of the resolution.
        points, segments: (N, POINT), (N,) of ``find_contour``, or carried on from there.
        stands_out: (S, S) whether one segment differs from another that is behind it.
        log_odds: (S, COLOURS) logarithm of how much more likely a colour is on the segment than beside it.
        stride: pixels of a line that are one sample.
        least_sigma_px: smallest sigma of a line.

    Returns:
        Information (S, 6, 6) and its vector (S, 6), for a change of world_T_segment in the segment's axes, rotation
        first; the lines (S,) that measure something; how far outward (N,) of each point its line has the contour [px],
        and the variance (N,) of that [px^2], NaN where the line measures nothing.
    """
    size = len(log_odds)
    information, vector = np.zeros((size, 6, 6)), np.zeros((size, 6))
    lines = np.zeros(size, np.int64)
    shifts, variances = np.full(len(points), math.nan), np.full(len(points), math.nan)
    row = np.empty(6)
    step = _smoothed_step()
    inside = np.empty(2 * (_REACH + _STEP) + 1)
    for n in range(len(points)):
        point, segment = points[n], segments[n]
        _read_line(image, labels, shrink, point, segment, stands_out, log_odds[segment], stride, inside)
        mean, variance = _parting(inside, step)
        if variance > _FLAT:
            continue
        robust = 1.0 / (1.0 + (mean / _FAR) ** 2)
        mean, variance = mean * stride, variance * stride * stride
        shifts[n], variances[n] = mean, variance
        weight = robust / (variance + least_sigma_px * least_sigma_px)
        # The pixel moves along the normal by slope . (turn x point + shift).
        X, Y, Z, a, b, c = point[4], point[5], point[6], point[7], point[8], point[9]
        row[0], row[1], row[2] = Y * c - Z * b, Z * a - X * c, X * b - Y * a
        row[3], row[4], row[5] = a, b, c
        for i in range(6):
            vector[segment, i] += weight * row[i] * mean
            for j in range(6):
                information[segment, i, j] += weight * row[i] * row[j]
        lines[segment] += 1
    return information, vector, lines, shifts, variances


@kernel()
def _smoothed_step() -> Array:
    """Probability of the segment's side at samples outward of where regions part."""
    step = np.empty(2 * _STEP + 1)
    for x in range(-_STEP, _STEP + 1):
        step[x + _STEP] = 0.5 - _SLOPE * math.tanh(x / (2.0 * _WIDTH))
    return step


@kernel()
def _read_line(
    image: Bytes,
    labels: Bytes,
    shrink: int,
    point: Array,
    segment: int,
    stands_out: Bytes,
    log_odds: NDArray[np.float32],
    stride: int,
    inside: Array,
) -> None:
    """Fill in the probability of being on the segment for each sample of a line, from inward to outward.

    Beyond the far side of a thin limb, and behind what has its colours, colours are no evidence.
    """
    reach = len(inside) // 2
    for direction in (-1, 1):
        is_told = True
        for sample in range(0 if direction < 0 else 1, reach + 1):
            odds = 0.0
            middle = direction * sample * stride
            if abs(middle) > shrink and is_told:
                label = label_at(labels, point[10] + middle * point[2], point[11] + middle * point[3], shrink)
                is_told = label == segment if direction < 0 else label < 0 or is_beside(stands_out, segment, label)
            if is_told:
                for within in range(stride):
                    along = middle + within - 0.5 * (stride - 1)
                    colour = _colour(image, point[0] + along * point[2], point[1] + along * point[3])
                    if colour >= 0:
                        odds += log_odds[colour]
            inside[direction * sample + reach] = 1.0 / (1.0 + math.exp(-max(-_SURE, min(_SURE, odds))))


@kernel()
def _parting(inside: Array, step: Array) -> tuple[float, float]:
    """Mean and variance of where a line's regions part, in samples outward of its middle."""
    total = mean = square = 0.0
    for shift in range(2 * _REACH + 1):
        likely = 1.0  # at worst 0.08 to the power of 15: no need for logarithms
        for x in range(2 * _STEP + 1):
            likely *= 1.0 - step[x] + (2.0 * step[x] - 1.0) * inside[shift + x]
        total += likely
        mean += likely * (shift - _REACH)
        square += likely * (shift - _REACH) ** 2
    mean /= total
    return mean, square / total - mean * mean
