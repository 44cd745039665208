"""New tracks are strong and keep their distance."""

import numpy as np

from bodycam_ros.tracking.keypoints import far_from, thin_out


def test_thinned_points_keep_their_distance_and_nothing_could_be_added() -> None:
    rng = np.random.default_rng(0)
    points = (rng.random((2000, 2)) * [640, 480]).astype(np.float32)
    kept = thin_out(points, rng.random(2000).astype(np.float32), 8.0)
    gaps = np.linalg.norm(points[:, None] - points[kept][None], axis=2)
    among_kept = gaps[kept]
    among_kept[np.arange(len(kept)), np.arange(len(kept))] = np.inf
    assert among_kept.min() > 8.0
    left_out = np.setdiff1d(np.arange(2000), kept)
    assert gaps[left_out].min(axis=1).max() <= 8.0


def test_the_stronger_of_two_stays_and_frees_what_the_weaker_would_have_taken() -> None:
    line = np.array([[0, 0], [3, 0], [6, 0]], np.float32)
    assert thin_out(line, np.array([1, 2, 3], np.float32), 4.0).tolist() == [0, 2]
    assert thin_out(line, np.array([1, 3, 2], np.float32), 4.0).tolist() == [1]


def test_points_far_from_others() -> None:
    points = np.array([[0, 0], [10, 0]], np.float32)
    assert far_from(points, np.array([[1, 1]], np.float32), 3.0).tolist() == [False, True]
    assert far_from(points, np.zeros((0, 2), np.float32), 3.0).all()


def test_of_nothing_comes_nothing() -> None:
    none = np.zeros((0, 2), np.float32)
    assert len(thin_out(none, np.zeros(0, np.float32), 5.0)) == 0
    assert len(far_from(none, none, 5.0)) == 0
