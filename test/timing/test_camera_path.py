"""A path through a camera's poses: exact at images, and its variances are those of its errors between them."""

import numpy as np
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicHermiteSpline

from bodycam_ros.geometry import exp_se3, inverse, log_se3
from bodycam_ros.timing.camera_path import path_points

_GAP_NS = 33_000_000


def test_variances_are_zero_at_images_and_those_of_the_errors_between_them_where_a_camera_shakes() -> None:
    """The middle of five images of a shaking camera, left out: a white motion, which no curve can follow."""
    random = np.random.default_rng(3)
    normalised = []
    for _ in range(200):
        poses = exp_se3(np.array([0.3, 0.1, -0.2, 0.5, 0.0, 0.2]) * np.arange(7)[:, None] / 30.0)
        poses = poses @ exp_se3(random.normal(scale=np.repeat([0.005, 0.01], 3), size=(7, 6)))
        stamps_ns = _GAP_NS * np.arange(7)
        assert np.allclose(path_points(stamps_ns[::2], poses[::2], stamps_ns[::2], 1.0).variances, 0.0)
        point = path_points(stamps_ns[::2], poses[::2], stamps_ns[3:4], 1.0)
        normalised.append(log_se3(inverse(poses[3]) @ point.poses[0]) ** 2 / point.variances[0])
    # White motion is the worst there is: real ones are measured in camera_path.py.
    assert 1.5 < np.sqrt(np.median(normalised)) < 3.5


def test_a_camera_that_turns_and_moves_evenly_has_no_variance() -> None:
    """Three images or an even motion show no bend."""
    twist = np.array([0.3, 0.1, -0.2, 0.5, 0.0, 0.2])
    poses = exp_se3(twist * np.arange(4)[:, None] / 30.0)
    stamps_ns = _GAP_NS * np.arange(4)
    between_ns = np.array([stamps_ns[1] + _GAP_NS // 2])
    assert np.allclose(path_points(stamps_ns, poses, between_ns, 1.0).variances, 0.0, atol=1e-12)
    assert not path_points(stamps_ns[:3], poses[:3], between_ns, 1.0).variances.any()


def test_points_are_those_of_scipys_curves_whose_slopes_are_those_of_parabolas() -> None:
    """Images at uneven times; stamps between them, at one of them, in a gap that is too long, and before them all."""
    stamps_s = np.array([0.0, 0.03, 0.07, 0.10, 0.25, 0.29])
    poses = exp_se3(np.random.default_rng(5).normal(scale=0.2, size=(6, 6)))
    steps = log_se3(inverse(poses[:-1]) @ poses[1:])
    slopes = [
        Polynomial.fit(stamps_s[[k - 1, k, k + 1]] - stamps_s[k], [-before, 0.0, after], 2, domain=[]).deriv()(0.0)
        for axis in range(6)
        for k, before, after in zip(range(1, 5), steps[:-1, axis], steps[1:, axis], strict=True)
    ]
    twists = np.array(slopes).reshape(6, 4).T
    wanted_s = np.array([-0.01, 0.04, 0.07, 0.09, 0.2])
    points = path_points(np.rint(1e9 * stamps_s).astype(int), poses, np.rint(1e9 * wanted_s).astype(int), 0.1)
    assert points.rows.tolist() == [1, 2, 3]
    assert points.nearest.tolist() == [1, 2, 3]
    for pose, twist, k, at_s in zip(points.poses, points.twists, (1, 2, 2), wanted_s[1:4], strict=True):
        share = (at_s - stamps_s[k]) / (stamps_s[k + 1] - stamps_s[k])
        ends = [twists[k - 1], twists[k]]
        curve = CubicHermiteSpline(stamps_s[k : k + 2], [np.zeros(6), steps[k]], ends)
        assert np.allclose(pose, poses[k] @ exp_se3(curve(at_s)), atol=1e-9)
        assert np.allclose(twist, (1.0 - share) * ends[0] + share * ends[1], atol=1e-7)
