import numpy as np

from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.pairs import PairSettings, probe_overlap, promising_pairs


def photograph(name, descriptors):
    n = len(descriptors)
    return ImageFeatures(name, np.zeros((n, 2), "f4"), np.ones(n, "f4"), descriptors, np.zeros((n, 3), "u1"))


def root_sifts(rng, n):
    shares = rng.dirichlet(np.full(128, 0.3), size=n)
    return np.round(512 * np.sqrt(shares)).clip(0, 255).astype(np.uint8)


def test_counts_are_of_features_in_common():
    rng = np.random.default_rng(3)
    here, there = root_sifts(rng, 200), root_sifts(rng, 200)
    mixed = np.concatenate([here[40:70], root_sifts(rng, 150)])
    noisy = np.clip(mixed.astype(int) + rng.integers(-3, 4, mixed.shape), 0, 255).astype(np.uint8)
    features = [photograph("a", here), photograph("b", there), photograph("c", noisy)]
    counts = np.array(list(probe_overlap(features, PairSettings())))
    assert counts[2, 0] in range(28, 33)
    assert counts[1, 0] <= 2 and counts[2, 1] <= 2
    assert np.array_equal(counts, np.tril(counts, -1))


def test_pairs_are_the_best_partners_of_either_photograph():
    counts = np.array([[0, 0, 0, 0], [50, 0, 0, 0], [40, 30, 0, 0], [3, 20, 0, 0]])
    settings = PairSettings(max_partners=2, min_probe_matches=8, spanning_trees=0)
    # 1-3 is the best that 3 has, though not among the two best of 1.
    assert promising_pairs(counts, settings) == [(0, 1), (0, 2), (1, 2), (1, 3)]
    settings = PairSettings(max_partners=2, min_probe_matches=25, spanning_trees=0)
    assert promising_pairs(counts, settings) == [(0, 1), (0, 2), (1, 2)]


def test_groups_are_tied_by_their_best_pairs():
    counts = np.zeros((8, 8), dtype=int)
    counts[:4, :4] = counts[4:, 4:] = 100
    counts[6, 1], counts[7, 2], counts[5, 3] = 30, 20, 10
    counts = np.tril(counts, -1)
    inside = {(i, j) for i in range(8) for j in range(i + 1, 8) if (i < 4) == (j < 4)}
    for trees, ties in [(0, set()), (1, {(1, 6)}), (2, {(1, 6), (2, 7)})]:
        pairs = promising_pairs(counts, PairSettings(max_partners=3, spanning_trees=trees))
        assert set(pairs) == inside | ties and len(pairs) == len(set(pairs))
