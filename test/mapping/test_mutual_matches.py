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
