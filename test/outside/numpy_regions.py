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


@dataclass(frozen=True, eq=False)
class Front:
    """Who is in front, at a part of the image's resolution, and before whom each segment stands out (S, S)."""

    labels: Image
    shrink: int
    stands_out: Image
    nobody: int

    def is_beside(self, segment: int, seen: Whole) -> NDArray[np.bool_]:
        """Which labels (N,) are those of nobody, or of segments that one differs from."""
        differs = np.append(self.stands_out[segment], np.zeros(self.nobody + 1, np.uint8))[seen] > 0
        return (seen == self.nobody) | ((seen != OUTSIDE) & differs)

    def told(self, point: Array, segment: int, middles: Array) -> NDArray[np.bool_]:
        """Which samples (N,) of a line, so far outward [px], are of its own segment, or of what is beside that."""
        seen = labels_at(self.labels, point[10:12] + middles[:, None] * point[2:4], self.shrink)
        wanted = np.where(middles <= 0, seen == segment, (seen == OUTSIDE) | self.is_beside(segment, seen))
        wanted |= np.abs(middles) <= self.shrink
        centre = len(middles) // 2
        inward = np.cumprod(wanted[centre::-1])[::-1]
        return np.concatenate([inward, np.cumprod(wanted[centre + 1 :])]).astype(bool)


def count_in_numpy(
    image: Image, front: Front, points: Array, segments: Whole, inward: int, outward: int
) -> tuple[Array, Array]:
    """Inside (S, COLOURS) and outside, as ``count_colours``."""
    counts = np.zeros((2, len(front.stands_out), COLOURS))
    for point, segment in zip(points, segments, strict=True):
        for side, sign, reach in ((0, -1, inward), (1, 1, outward)):
            pixels = point[:2] + sign * np.arange(_GAP, reach)[:, None] * point[2:4]
            found = pixels - point[:2] + point[10:12]
            colours, seen = colours_at(image, pixels), labels_at(front.labels, found, front.shrink)
            wanted = seen == segment if side == 0 else front.is_beside(segment, seen)
            run = np.cumprod(wanted & (colours != OUTSIDE)).astype(bool)  # until the first that is not
            np.add.at(counts[side, segment], colours[run], 1.0)
    return counts[0], counts[1]


def areas_in_numpy(image: Image, front: Front) -> Array:
    """(S, COLOURS) of all pixels in front, as ``count_areas``."""
    counts = np.zeros((len(front.stands_out), COLOURS))
    row, column = np.indices(front.labels.shape)
    pixels = np.column_stack([column.ravel(), row.ravel()]) * front.shrink + 0.5 * (front.shrink - 1)
    there = front.labels.ravel() < len(counts)
    np.add.at(counts, (front.labels.ravel()[there], colours_at(image, pixels[there])), 1.0)
    return counts


def lines_in_numpy(
    image: Image, front: Front, points: Array, segments: Whole, log_odds: NDArray[np.float32], stride: int
) -> Iterator[Line]:
    """What every line knows that knows something."""
    shifts, around = np.arange(-_REACH, _REACH + 1), np.arange(-_STEP, _STEP + 1)
    step = 0.5 - _SLOPE * np.tanh(around / (2.0 * _WIDTH))
    samples = np.arange(-_REACH - _STEP, _REACH + _STEP + 1)
    along = samples[:, None] * stride + np.arange(stride) - 0.5 * (stride - 1)
    for row, (point, segment) in enumerate(zip(points, segments, strict=True)):
        colours = colours_at(image, point[:2] + along.reshape(-1, 1) * point[2:4]).reshape(along.shape)
        odds = np.where(colours == OUTSIDE, 0.0, log_odds[segment].astype(float)[colours]).sum(axis=1)
        odds[~front.told(point, segment, samples * stride)] = 0.0
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
    front: Front,
    points: Array,
    segments: Whole,
    log_odds: NDArray[np.float32],
    stride: int,
    least_sigma_px: float,
) -> tuple[Array, Array, Whole]:
    """Information (S, 6, 6), vector (S, 6) and lines (S,), as ``ask_lines``."""
    size = len(log_odds)
    information, vector, lines = np.zeros((size, 6, 6)), np.zeros((size, 6)), np.zeros(size, np.int64)
    for line in lines_in_numpy(image, front, points, segments, log_odds, stride):
        point, segment = points[line.row], segments[line.row]
        slope = np.concatenate([np.cross(point[4:7], point[7:10]), point[7:10]])
        weight = 1.0 / (line.variance + least_sigma_px**2)
        information[segment] += weight * np.outer(slope, slope)
        vector[segment] += weight * line.mean * slope
        lines[segment] += 1
    return information, vector, lines
