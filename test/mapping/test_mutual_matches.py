import numpy as np

from bodycam_ros.mapping.mutual_matches import mutual_matches


def root_sifts(rng, n):
    shares = rng.dirichlet(np.full(128, 0.3), size=n)
    return np.round(512 * np.sqrt(shares)).clip(0, 255).astype(np.float32)


def noisy(rng, descriptors):
    """The same descriptors a little changed, and of the length that they have."""
    changed = np.clip(descriptors + rng.normal(0.0, 8.0, descriptors.shape), 0.0, 255.0)
    return (512.0 * changed / np.linalg.norm(changed, axis=1, keepdims=True)).astype(np.float32)


def by_distances(first, second, max_ratio):
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    pairs = []
    for i, row in enumerate(distances):
        j = int(row.argmin())
        best, following = np.sort(row)[:2]
        if distances[:, j].argmin() == i and best < max_ratio * following:
            pairs.append((i, j))
    return pairs


def test_matches_are_those_of_all_distances():
    rng = np.random.default_rng(3)
    first = root_sifts(rng, 80)
    second = np.concatenate([noisy(rng, first[20:60]), root_sifts(rng, 30)])
    found = mutual_matches(first, second, 0.8)
    assert [tuple(pair) for pair in found.tolist()] == by_distances(first, second, 0.8)
    assert len(found) >= 40


def test_what_is_there_twice_is_left_out():
    rng = np.random.default_rng(4)
    first = root_sifts(rng, 50)
    once, again = (noisy(rng, first) for _ in range(2))
    assert len(mutual_matches(first, once, 0.8)) == 50
    assert len(mutual_matches(first, np.concatenate([once, again]), 0.8)) < 5


def test_nothing_matches_what_is_empty():
    some, nothing = np.ones((5, 128), np.float32), np.zeros((0, 128), np.float32)
    for first, second in ((nothing, some), (some, nothing), (some, some[:1])):
        assert mutual_matches(first, second, 0.8).shape == (0, 2)
