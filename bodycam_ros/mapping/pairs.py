"""Which photographs see the same things: the pairs that are worth matching in full."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.mutual_matches import mutual_matches
from bodycam_ros.mapping.progress import in_parallel
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class PairSettings:
    """How pairs of photographs are chosen, and matched before their poses are known."""

    probe_features: int = setting(
        500,
        unit="per photograph",
        limits=(50, 3000),
        reason="largest features that decide whether two photographs overlap",
    )
    probe_ratio: float = setting(
        0.8, limits=(0.5, 0.95), reason="a probe matches if its nearest descriptor is this much nearer than the second"
    )
    min_probe_matches: int = setting(
        8, limits=(1, 100), reason="fewer mutual probe matches are chance; of pairs with a dozen four in five overlap"
    )
    max_partners: int = setting(
        16, unit="per photograph", limits=(2, 500), reason="best partners of each photograph that are matched in full"
    )
    spanning_trees: int = setting(
        3, limits=(0, 10), reason="independent ties between groups of photographs, so that one weak tie does no harm"
    )
    registering_features: int = setting(
        1000,
        unit="per photograph",
        limits=(200, 20000),
        reason="largest features that find the poses, to some pixels; with all of them it takes five times as long",
    )


def probe_overlap(
    features: Sequence[ImageFeatures], settings: PairSettings, workers: int = 1
) -> Iterator[NDArray[np.int64]]:
    """Count mutual matches among the largest features of all pairs (preemptive matching, Wu 2013, section 3).

    Yields:
        for each photograph i the (K,) counts with the photographs before it, zero from itself on.
    """
    probes = [f.descriptors[: settings.probe_features].astype(np.float32) for f in features]

    def counts_with_those_before(i: int) -> NDArray[np.int64]:
        counts = np.zeros(len(probes), dtype=np.int64)
        counts[:i] = [len(mutual_matches(probes[i], probe, settings.probe_ratio)) for probe in probes[:i]]
        return counts

    return in_parallel(counts_with_those_before, range(len(probes)), workers)


def promising_pairs(counts: NDArray[np.int64], settings: PairSettings) -> list[tuple[int, int]]:
    """Pairs (i, j) of rows, i < j, from counts (K, K): the best partners of either, and what holds groups together.

    Photographs of one corner may all be each other's best partners. Spanning trees of the largest counts tie such
    a group to the others.
    """
    from scipy.sparse.csgraph import minimum_spanning_tree

    counts = counts + counts.T
    # Ties go to the lower row, on every machine.
    best = np.argsort(-counts, axis=1, kind="stable")[:, : settings.max_partners]
    chosen = np.zeros(counts.shape, dtype=bool)
    np.put_along_axis(chosen, best, True, axis=1)
    candidates = np.where(counts >= settings.min_probe_matches, counts, 0)
    chosen &= candidates > 0
    for _ in range(settings.spanning_trees):
        tree = minimum_spanning_tree(-candidates.astype(np.float64)).toarray() != 0.0
        tree |= tree.T
        chosen |= tree
        candidates[tree] = 0
    rows, columns = np.nonzero(np.triu(chosen | chosen.T, k=1))
    return list(zip(rows.tolist(), columns.tolist(), strict=True))
