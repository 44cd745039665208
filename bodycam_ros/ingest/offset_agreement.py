"""The offsets on which all pairs of cameras agree: one pair alone may be a step of a walk off, a circle may not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.motion_correlation import OffsetCurve

Pair = tuple[str, str]
Whole = NDArray[np.int64]

_ROUNDS = 30
_STARTS = 8
"""Spanning trees to begin with: of the surest pairs first, then of pairs drawn by lot among the sure ones."""


@dataclass(frozen=True)
class AgreedOffset:
    """Where one camera starts.

    Attributes:
        samples: its offset against the reference.
        confidence: 0 to 1, how far its evidence stands above the next best offset's and above chance.
    """

    samples: int
    confidence: float


def agreed_offsets(
    reference: str, curves: Mapping[Pair, OffsetCurve], chance: Mapping[Pair, OffsetCurve], apart: int
) -> dict[str, AgreedOffset]:
    """Offsets that maximise the evidence of all pairs together, for the cameras that pairs link to the reference.

    From a spanning tree on, the cameras on one side of an edge are moved against the others to wherever all pairs
    across have most evidence, and each camera on its own, until nothing gains.

    Args:
        reference: the camera whose offset is 0.
        curves: (first, second) -> evidence for ``offset_second - offset_first``.
        chance: (first, second) -> evidence with the second's time reversed, for ``-offset_second - offset_first``: what
            two such motions have in common by chance.
        apart: offsets that differ by less are the same answer [samples].
    """
    best: dict[str, int] = {}
    best_parts: list[frozenset[str]] = []
    most = -np.inf
    for start in range(_STARTS):
        tree = _spanning_tree(reference, curves, np.random.default_rng(start) if start else None)
        offsets = _along(reference, tree, curves)
        parts = _parts(reference, tree)
        for _ in range(_ROUNDS):
            if not any([_move(part, offsets, curves) for part in parts]):
                break
        evidence = _evidence(offsets, curves)
        if evidence > most:
            best, best_parts, most = offsets, parts, evidence
    confidence = dict.fromkeys(best, 1.0)
    for part in best_parts:
        clear = _clear(part, best, curves, chance, apart)
        for camera in part:
            confidence[camera] = min(confidence[camera], clear)
    return {camera: AgreedOffset(samples, confidence[camera]) for camera, samples in best.items()}


def _spanning_tree(reference: str, curves: Mapping[Pair, OffsetCurve], lot: np.random.Generator | None) -> list[Pair]:
    """Edges of a tree from the reference to all that it reaches, (known, new), the surest first (Prim 1957)."""
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


def _along(reference: str, tree: Sequence[Pair], curves: Mapping[Pair, OffsetCurve]) -> dict[str, int]:
    offsets = {reference: 0}
    for known, new in tree:
        step = curves[known, new].best if (known, new) in curves else -curves[new, known].best
        offsets[new] = offsets[known] + step
    return offsets


def _parts(reference: str, tree: Sequence[Pair]) -> list[frozenset[str]]:
    """What may be moved as one: what hangs on each edge, and each camera alone."""
    parts = [frozenset([new]) for _, new in tree]
    for _, new in tree:
        hanging = {new}
        for known, newer in tree:
            if known in hanging:
                hanging.add(newer)
        parts.append(frozenset(hanging))
    # The reference stays; moving it alone is moving all others.
    parts.append(frozenset(new for _, new in tree))
    return list(dict.fromkeys(part for part in parts if part))


def _crossing(part: frozenset[str], offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]) -> list[Pair]:
    return [pair for pair in curves if (pair[0] in part) != (pair[1] in part) and pair[0] in offsets]


def _across(
    part: frozenset[str], offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]
) -> tuple[Whole, NDArray[np.float64]]:
    """Shifts of a part against the rest, and the evidence of all pairs across for each."""
    crossing = _crossing(part, offsets, curves)
    reach = [_shifts_of(pair, part, offsets, curves[pair]) for pair in crossing]
    shifts = np.arange(min(low for low, _ in reach), max(high for _, high in reach) + 1)
    evidence = np.zeros(len(shifts))
    for first, second in crossing:
        sign = 1 if second in part else -1
        evidence += curves[first, second].at(offsets[second] - offsets[first] + sign * shifts)
    return shifts, evidence


def _shifts_of(pair: Pair, part: frozenset[str], offsets: Mapping[str, int], curve: OffsetCurve) -> tuple[int, int]:
    now = offsets[pair[1]] - offsets[pair[0]]
    low, high = curve.lowest - now, curve.lowest + len(curve.values) - 1 - now
    return (low, high) if pair[1] in part else (-high, -low)


def _move(part: frozenset[str], offsets: dict[str, int], curves: Mapping[Pair, OffsetCurve]) -> bool:
    """Move a part to where the pairs across have most evidence; whether it moved."""
    shifts, evidence = _across(part, offsets, curves)
    shift = int(shifts[np.argmax(evidence)])
    if shift == 0:
        return False
    for camera in part:
        offsets[camera] += shift
    return True


def _clear(
    part: frozenset[str],
    offsets: Mapping[str, int],
    curves: Mapping[Pair, OffsetCurve],
    chance: Mapping[Pair, OffsetCurve],
    apart: int,
) -> float:
    """How far the evidence for a part's place stands above that for any other and above chance, as a share of it."""
    shifts, evidence = _across(part, offsets, curves)
    here = float(evidence[np.abs(shifts) < apart].max())
    elsewhere = float(evidence[np.abs(shifts) >= apart].max(initial=0.0))
    return max(0.0, 1.0 - max(elsewhere, _by_chance(part, offsets, chance)) / here) if here > 0.0 else 0.0


def _by_chance(part: frozenset[str], offsets: Mapping[str, int], chance: Mapping[Pair, OffsetCurve]) -> float:
    """The most evidence that a part has with the rest at any shift if its time runs backwards."""
    # Reversing the first of a pair is reversing the second and the shift, so one formula serves both.
    curves = {pair: chance[pair] for pair in _crossing(part, offsets, chance)}
    places = {(first, second): offsets[first] + offsets[second] for first, second in curves}
    low = min(curve.lowest + places[pair] for pair, curve in curves.items())
    high = max(curve.lowest + len(curve.values) + places[pair] for pair, curve in curves.items())
    shifts = np.arange(low, high)
    evidence = np.zeros(len(shifts))
    for pair, curve in curves.items():
        evidence += curve.at(shifts - places[pair])
    return float(evidence.max())


def _evidence(offsets: Mapping[str, int], curves: Mapping[Pair, OffsetCurve]) -> float:
    return sum(
        float(curve.at(np.array([offsets[second] - offsets[first]]))[0])
        for (first, second), curve in curves.items()
        if first in offsets
    )
