"""The offsets on which all pairs of cameras agree: one pair alone may be a step of a walk off, a circle may not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[str, str]
Whole = NDArray[np.int64]

_ROUNDS = 30
_TREES = 8  # to start from: of the pairs with most evidence first, then of pairs drawn by lot


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

    @property
    def best(self) -> int:
        """The offset with the most evidence, in samples."""
        return self.lowest + int(np.argmax(self.values))


class AgreedOffset(NamedTuple):
    """Offset from the reference [samples], and 0 to 1 how far its evidence is above the next best's and chance."""

    samples: int
    confidence: float


def agreed_offsets(
    reference: str, curves: Mapping[Pair, OffsetCurve], apart: int, chance: Mapping[Pair, OffsetCurve] | None = None
) -> dict[str, AgreedOffset]:
    """Offsets that maximise the evidence of all pairs together, for the cameras that pairs link to the reference.

    From a spanning tree on, the cameras on one side of an edge are moved against the others to wherever all pairs
    across have most evidence, and each camera on its own, until nothing gains.

    Args:
        reference: the camera whose offset is 0.
        curves: (first, second) -> evidence for ``offset_second - offset_first``.
        apart: offsets that differ by less are the same answer [samples].
        chance: (first, second) -> evidence with the second's time reversed, for ``-offset_second - offset_first``: what
            two such motions have in common by chance.
    """
    best: dict[str, int] = {reference: 0}
    best_parts: list[frozenset[str]] = []
    most = -np.inf
    for tree_number in range(_TREES):
        tree = _spanning_tree(reference, curves, np.random.default_rng(tree_number) if tree_number else None)
        offsets = {reference: 0}
        for known, new in tree:
            offsets[new] = offsets[known] + _directed(curves, known, new)
        parts = _parts(tree)
        for _ in range(_ROUNDS):
            if not any([_move(part, offsets, curves) for part in parts]):
                break
        evidence = sum(
            float(curve.evidence(np.array([offsets[second] - offsets[first]]))[0])
            for (first, second), curve in curves.items()
            if first in offsets
        )
        if evidence > most:
            best, best_parts, most = offsets, parts, evidence
    confidence = dict.fromkeys(best, 1.0)
    for part in best_parts:
        lead = _lead(part, best, curves, apart, chance)
        for camera in part:
            confidence[camera] = min(confidence[camera], lead)
    return {camera: AgreedOffset(samples, confidence[camera]) for camera, samples in best.items()}


def _spanning_tree(reference: str, curves: Mapping[Pair, OffsetCurve], lot: np.random.Generator | None) -> list[Pair]:
    """Edges (known, new) of a tree from the reference to all that it reaches, most evidence first (Prim 1957)."""
    sure = {pair: float(curve.values.max()) for pair, curve in curves.items()}
    if lot is not None:
        sure = {pair: value * lot.uniform(0.2, 1.0) for pair, value in sure.items()}
    reached, tree = {reference}, []
    while across := [pair for pair in curves if (pair[0] in reached) != (pair[1] in reached)]:
        first, second = max(across, key=lambda pair: sure[pair])
        edge = (first, second) if first in reached else (second, first)
        tree.append(edge)
        reached.add(edge[1])
    return tree


def _directed(curves: Mapping[Pair, OffsetCurve], known: str, new: str) -> int:
    return curves[known, new].best if (known, new) in curves else -curves[new, known].best


def _parts(tree: Sequence[Pair]) -> list[frozenset[str]]:
    """What is moved as one: what hangs on each edge, and each camera alone; the reference by all the others."""
    parts = [frozenset([new]) for _, new in tree]
    for _, new in tree:
        hanging = {new}
        for known, newer in tree:
            if known in hanging:
                hanging.add(newer)
        parts.append(frozenset(hanging))
    parts.append(frozenset(new for _, new in tree))
    return list(dict.fromkeys(part for part in parts if part))


def _across(
    part: frozenset[str], offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]
) -> tuple[Whole, Array]:
    """Shifts of a part against the rest, and the evidence of all pairs across for each."""
    crossing = {}
    for (first, second), curve in curves.items():
        if (first in part) != (second in part) and first in offsets:
            now = offsets[second] - offsets[first]
            low, high = curve.lowest - now, curve.lowest + len(curve.values) - 1 - now
            crossing[first, second] = (low, high) if second in part else (-high, -low)
    shifts = np.arange(min(low for low, _ in crossing.values()), max(high for _, high in crossing.values()) + 1)
    evidence = np.zeros(len(shifts))
    for first, second in crossing:
        sign = 1 if second in part else -1
        evidence += curves[first, second].evidence(offsets[second] - offsets[first] + sign * shifts)
    return shifts, evidence


def _move(part: frozenset[str], offsets: dict[str, int], curves: Mapping[Pair, OffsetCurve]) -> bool:
    """Move a part to where the pairs across have most evidence; whether it moved."""
    shifts, evidence = _across(part, offsets, curves)
    shift = int(shifts[np.argmax(evidence)])
    for camera in part:
        offsets[camera] += shift
    return shift != 0


def _lead(
    part: frozenset[str],
    offsets: Mapping[str, int],
    curves: Mapping[Pair, OffsetCurve],
    apart: int,
    chance: Mapping[Pair, OffsetCurve] | None,
) -> float:
    """How far the evidence for a part's offset is above that for any other and above chance, as a share of it."""
    shifts, evidence = _across(part, offsets, curves)
    here = float(evidence[np.abs(shifts) < apart].max())
    elsewhere = float(evidence[np.abs(shifts) >= apart].max(initial=0.0))
    if chance is not None:
        across = {pair: curve for pair, curve in chance.items() if (pair[0] in part) != (pair[1] in part)}
        elsewhere = max(elsewhere, _by_chance(across, offsets))
    return max(0.0, 1.0 - elsewhere / here) if here > 0.0 else 0.0


def _by_chance(curves: Mapping[Pair, OffsetCurve], offsets: Mapping[str, int]) -> float:
    """The most evidence that a part has with the rest at any shift if its time runs backwards.

    Reversing the first of a pair is reversing the second and the shift, so one formula serves both.
    """
    known = {pair: curve for pair, curve in curves.items() if pair[0] in offsets}
    places = {(first, second): offsets[first] + offsets[second] for first, second in known}
    low = min(curve.lowest + places[pair] for pair, curve in known.items())
    high = max(curve.lowest + len(curve.values) + places[pair] for pair, curve in known.items())
    shifts = np.arange(low, high)
    return float(sum((curve.evidence(shifts - places[pair]) for pair, curve in known.items()), np.zeros(1)).max())
