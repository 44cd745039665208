"""Colours beside a contour, and lines across it, in NumPy, point by point: what the compiled ones are held to."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.outside.region_kernels import (
    _FLAT,
    _GAP,
    _REACH,
    _SLOPE,
    _STEP,
    _SURE,
    _WIDTH,
    BINS,
    COLOURS,
)

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Whole = NDArray[np.int64]

OUTSIDE = -1


@dataclass(frozen=True)
class Line:
    """What one line knows: how far outward regions part, and how surely [px, px^2]."""

    row: int
    mean: float
    variance: float


def colours_at(image: Image, pixels: Array) -> Whole:
    """(N,) bins of the colours at pixels (N, 2), ``OUTSIDE`` of the image."""
    x, y = np.floor(pixels + 0.5).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < image.shape[1]) & (y < image.shape[0])
    bins = image[np.where(inside, y, 0), np.where(inside, x, 0)].astype(int) * BINS // 256
    return np.where(inside, bins @ [BINS**2, BINS, 1], OUTSIDE)


def labels_at(labels: Image, pixels: Array, shrink: int) -> Whole:
    x, y = np.floor((pixels + 0.5) / shrink).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < labels.shape[1]) & (y < labels.shape[0])
    return np.where(inside, labels[np.where(inside, y, 0), np.where(inside, x, 0)].astype(int), OUTSIDE)


def count_in_numpy(
    image: Image,
    labels: Image,
    shrink: int,
    points: Array,
    segments: Whole,
    stands_out: Image,
    inward: int,
    outward: int,
    nobody: int,
) -> tuple[Array, Array]:
    """Inside (S, COLOURS) and outside, as ``count_colours``."""
    counts = np.zeros((2, len(stands_out), COLOURS))
    for point, segment in zip(points, segments, strict=True):
        for side, sign, reach in ((0, -1, inward), (1, 1, outward)):
            pixels = point[:2] + sign * np.arange(_GAP, reach)[:, None] * point[2:4]
            colours, seen = colours_at(image, pixels), labels_at(labels, pixels, shrink)
            differs = np.append(stands_out[segment], np.zeros(nobody + 1, np.uint8))[seen] > 0
            wanted = (seen == segment) if side == 0 else (seen != OUTSIDE) & ((seen == nobody) | differs)
            run = np.cumprod(wanted & (colours != OUTSIDE)).astype(bool)  # until the first that is not
            np.add.at(counts[side, segment], colours[run], 1.0)
    return counts[0], counts[1]


def lines_in_numpy(
    image: Image, points: Array, segments: Whole, log_odds: NDArray[np.float32], stride: int
) -> Iterator[Line]:
    """What every line knows that knows something."""
    shifts, around = np.arange(-_REACH, _REACH + 1), np.arange(-_STEP, _STEP + 1)
    step = 0.5 - _SLOPE * np.tanh(around / (2.0 * _WIDTH))
    samples = np.arange(-_REACH - _STEP, _REACH + _STEP + 1)
    along = samples[:, None] * stride + np.arange(stride) - 0.5 * (stride - 1)
    for row, (point, segment) in enumerate(zip(points, segments, strict=True)):
        colours = colours_at(image, point[:2] + along.reshape(-1, 1) * point[2:4]).reshape(along.shape)
        odds = np.where(colours == OUTSIDE, 0.0, log_odds[segment].astype(float)[colours]).sum(axis=1)
        inside = 1.0 / (1.0 + np.exp(-odds.clip(-_SURE, _SURE)))
        window = inside[shifts[:, None] + around + _REACH + _STEP]
        likelihood = np.prod(step * window + (1.0 - step) * (1.0 - window), axis=1)
        share = likelihood / likelihood.sum()
        mean = float(share @ shifts)
        variance = float(share @ (shifts - mean) ** 2)
        if variance <= _FLAT:
            yield Line(row, mean * stride, variance * stride**2)


def ask_in_numpy(
    image: Image,
    points: Array,
    segments: Whole,
    log_odds: NDArray[np.float32],
    stride: int,
    least_sigma_px: float,
) -> tuple[Array, Array, Whole]:
    """Information (S, 6, 6), vector (S, 6) and lines (S,), as ``ask_lines``."""
    size = len(log_odds)
    information, vector, lines = np.zeros((size, 6, 6)), np.zeros((size, 6)), np.zeros(size, np.int64)
    for line in lines_in_numpy(image, points, segments, log_odds, stride):
        point, segment = points[line.row], segments[line.row]
        slope = np.concatenate([np.cross(point[4:7], point[7:10]), point[7:10]])
        weight = 1.0 / (line.variance + least_sigma_px**2)
        information[segment] += weight * np.outer(slope, slope)
        vector[segment] += weight * line.mean * slope
        lines[segment] += 1
    return information, vector, lines
