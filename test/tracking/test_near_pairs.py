"""Pairs of near points against SciPy's tree."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from bodycam_ros.tracking.near_pairs import near_pairs


@pytest.mark.parametrize("radius", [0.5, 4.0, 20.0, 150.0, 2000.0])
def test_pairs_are_scipys(radius: float) -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.5, 639.5, (300, 2)).astype(np.float32)
    others = np.concatenate([rng.uniform(-0.5, 639.5, (400, 2)), points[:5] + [radius, 0.0]])
    rows, near, squared = near_pairs(points, others, radius)
    expected = cKDTree(points).sparse_distance_matrix(cKDTree(others), radius, output_type="coo_matrix")
    order, of = np.lexsort((near, rows)), np.lexsort((expected.col, expected.row))
    np.testing.assert_array_equal(rows[order], expected.row[of])
    np.testing.assert_array_equal(near[order], expected.col[of])
    np.testing.assert_allclose(np.sqrt(squared[order]), expected.data[of], rtol=1e-12)
    assert (np.diff(rows) >= 0).all()


def test_no_points_have_no_pairs() -> None:
    nothing, some = np.zeros((0, 2)), np.zeros((3, 2))
    assert all(len(found) == 0 for pair in ((nothing, some), (some, nothing)) for found in near_pairs(*pair, 1.0))
