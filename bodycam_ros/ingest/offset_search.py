"""Offsets between the clocks of cameras that recorded the same: a sound, or the motion of one body.

The signals of a pair are compared at every offset by the mutual information of two Gaussian variables
(-1/2 log det(1 - squared canonical correlations)): it needs neither the gains of microphones nor the mounts of cameras,
nor that all axes of a limb follow its neighbour's. One pair alone may be a step of a walk off, so each camera is placed
by all pairs that it has with those placed before it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[str, str]
Whole = NDArray[np.int64]

_SEARCHED_S = 300.0  # the liveliest stretch of this length decides which second; drift is 30 ms within it at most
MIN_OVERLAP_S = 2.0  # shorter stretches resemble each other by chance
_MIN_SHARE = 0.1  # of the shorter recording that two must have in common
_APART_S = 0.25  # a second best offset within this is the flank of the best
_REGULAR = 1e-4  # of the largest variance, so that a motion about one axis can be inverted
_CLOSEST = 0.99  # canonical correlation


@dataclass(frozen=True, eq=False)
class Signal:
    """What a camera recorded, evenly sampled; the same rate for all cameras.

    Attributes:
        first: media time of the first sample, in samples.
        values: (N, K) of K components.
        liveliness: (N,) how much goes on.
    """

    first: int
    values: Array
    liveliness: Array

    def part(self, begin: int, end: int) -> "Signal":
        """Samples from one media time to before another, in samples."""
        low, high = np.clip([begin - self.first, end - self.first], 0, len(self.values)).tolist()
        return Signal(self.first + low, self.values[low:high], self.liveliness[low:high])


@dataclass(frozen=True, eq=False)
class OffsetCurve:
    """Evidence of a pair of cameras for each offset ``start_second - start_first``.

    Attributes:
        lowest: the smallest offset, in samples.
        values: (L) evidence at ``lowest + i`` samples, in robust standard deviations above its median.
    """

    lowest: int
    values: Array

    def evidence(self, offsets: Whole) -> Array:
        """Evidence (N) at offsets (N) in samples; none where the cameras hardly overlap."""
        index = offsets - self.lowest
        inside = (index >= 0) & (index < len(self.values))
        return np.where(inside, self.values[np.clip(index, 0, len(self.values) - 1)], 0.0)

    def reversed(self) -> "OffsetCurve":
        """The same evidence for ``start_first - start_second``."""
        return OffsetCurve(1 - self.lowest - len(self.values), self.values[::-1])


def offset_curves(
    signals: Mapping[str, Signal],
    pairs: Sequence[Pair],
    rate_hz: float,
    max_offset_s: float,
    on_pair: Callable[[], None] = lambda: None,
) -> dict[Pair, OffsetCurve]:
    """Evidence for the offsets of pairs, by a stretch of the shorter recording of each; none of pairs hardly in common.

    Args:
        signals: camera -> its signal.
        pairs: of cameras.
        rate_hz: samples per second.
        max_offset_s: no camera starts later than another by more [s].
        on_pair: called for each pair.
    """
    length, most = round(_SEARCHED_S * rate_hz), round(max_offset_s * rate_hz)
    liveliest, curves = _liveliest(list(signals.values()), length) if pairs else 0, {}
    for pair in pairs:
        long, short = sorted((signals[name] for name in pair), key=lambda each: len(each.values), reverse=True)
        begin = max(short.first, min(liveliest, short.first + len(short.values) - length))
        short = short.part(begin, begin + length)
        curve = _offset_curve(long.part(begin - most, begin + length + most), short, rate_hz, most)
        if curve is not None:
            curves[pair] = curve if long is signals[pair[0]] else curve.reversed()
        on_pair()
    return curves


def _liveliest(signals: Sequence[Signal], length: int) -> int:
    """Media time at which the stretch begins in which most goes on in all cameras together, in samples."""
    first = min(signal.first for signal in signals)
    total = np.zeros(max(signal.first + len(signal.values) for signal in signals) - first)
    for signal in signals:
        total[signal.first - first :][: len(signal.values)] += signal.liveliness
    running = np.concatenate([[0.0], np.cumsum(total)])
    length = min(length, len(total))
    return first + int(np.argmax(running[length:] - running[:-length]))


def _offset_curve(first: Signal, second: Signal, rate_hz: float, most: int) -> OffsetCurve | None:
    """Evidence for every offset up to ``most`` samples; None where the two never overlap for long."""
    x, y = _whitened(first.values), _whitened(second.values)
    shifts = np.arange(-(len(y) - 1), len(x))
    offsets = shifts + first.first - second.first
    overlap = np.minimum(len(x), len(y) + shifts) - np.maximum(0, shifts)
    least = max(MIN_OVERLAP_S * rate_hz, _MIN_SHARE * min(len(x), len(y)))
    tried = (overlap >= least) & (np.abs(offsets) <= most)
    if tried.sum() < 2:
        return None
    length = scipy.fft.next_fast_len(len(x) + len(y), real=True)
    spectrum = np.fft.rfft(x, length, axis=0)[:, :, None] * np.conj(np.fft.rfft(y, length, axis=0))[:, None, :]
    # Not by how long they overlap: one clap met by chance at the very ends must not outdo two that meet.
    products = np.fft.irfft(spectrum, length, axis=0)[shifts[tried]] / min(len(x), len(y))
    values = -np.log1p(-(np.minimum(np.linalg.svd(products, compute_uv=False), _CLOSEST) ** 2)).sum(axis=1)
    values = values - np.median(values)
    values /= max(1.4826 * float(np.median(np.abs(values))), 1e-9)
    return OffsetCurve(int(offsets[tried][0]), values)


def _whitened(values: Array) -> Array:
    """Components (N, K) without mean, uncorrelated and of variance 1."""
    centred = values - values.mean(axis=0)
    spreads, axes = np.linalg.eigh(centred.T @ centred / len(values))
    white: Array = centred @ axes / np.sqrt(spreads + _REGULAR * spreads[-1] + 1e-9)
    return white


class AgreedOffset(NamedTuple):
    """Offset from the reference [samples], and 0 to 1 how far its evidence is above the next best's."""

    samples: int
    confidence: float


def agreed_offsets(
    reference: str, curves: Mapping[Pair, OffsetCurve], rate_hz: float, least: float = 0.0
) -> dict[str, AgreedOffset]:
    """Offsets by the evidence of all pairs together, for the cameras that pairs link to the reference.

    The camera whose best offset leads most is placed first, and each next one by all that are placed before it.

    Args:
        reference: the camera whose offset is 0.
        curves: (first, second) -> evidence for ``offset_second - offset_first``.
        rate_hz: samples per second.
        least: evidence of a pair that is more than chance.
    """
    towards: dict[str, dict[str, OffsetCurve]] = {}
    for (first, second), curve in curves.items():
        towards.setdefault(second, {})[first] = curve
        towards.setdefault(first, {})[second] = curve.reversed()
    agreed = {reference: AgreedOffset(0, 1.0)}
    while linked := [name for name in towards if name not in agreed and not agreed.keys().isdisjoint(towards[name])]:
        placed = {name: _place(towards[name], agreed, _APART_S * rate_hz, least) for name in linked}
        name = max(linked, key=lambda each: placed[each][1])
        agreed[name] = placed[name][0]
    return agreed


def _place(
    curves: Mapping[str, OffsetCurve], placed: Mapping[str, AgreedOffset], apart: float, least: float
) -> tuple[AgreedOffset, float]:
    """The offset of a camera by its curves towards those that are placed, and its lead over those ``apart`` or farther.

    It is as sure as its lead, but no surer than the camera that it is placed by, and not at all by chance.
    """
    there = {name: curve for name, curve in curves.items() if name in placed}
    starts = {name: curve.lowest + placed[name].samples for name, curve in there.items()}
    low, high = min(starts.values()), max(starts[name] + len(there[name].values) for name in there)
    offsets = np.arange(low, high)
    by_camera = {name: curve.evidence(offsets - placed[name].samples) for name, curve in there.items()}
    evidence = np.sum(list(by_camera.values()), axis=0)
    best = int(np.argmax(evidence))
    most, elsewhere = evidence[best], evidence[np.abs(offsets - offsets[best]) >= apart].max(initial=0.0)
    lead = float(most - elsewhere)
    surest = max(by_camera, key=lambda name: by_camera[name][best])
    is_chance = most < least * np.sqrt(len(there))
    confidence = 0.0 if is_chance else min(placed[surest].confidence, max(0.0, lead / float(most)))
    return AgreedOffset(int(offsets[best]), confidence), lead
