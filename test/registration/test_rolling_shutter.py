"""Rows that are read out one after the other: where landmarks show, and the fit that takes it into account."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.numpy_pose_fit import Point, Problem, seen_later
from helpers.rolling_camera import constant_twist, landmarks_ahead, rolling_pixels, wide_camera

from bodycam_ros.geometry import exp_se3, inverse, log_se3, transform_points
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.tracking.camera_motion import ImageMotion

READOUT_S = 0.012
TWIST = np.array([1.5, -2.0, 1.0, 0.6, -0.4, 0.8])
SIGMAS = np.repeat([0.5, 0.15], 3)
POSE = exp_se3(np.array([0.3, -0.2, 0.5, 0.4, -0.3, 0.2]))
CAMERA = wide_camera()


def motion(readout_s: float, sigma_s: float, twist: np.ndarray = TWIST, share: float = 1.0) -> ImageMotion:
    return ImageMotion(readout_s, sigma_s, np.eye(4), np.zeros(6), twist, share * SIGMAS, twist[:3])


def scene(count: int, twist: np.ndarray = TWIST, readout_s: float = READOUT_S) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks (N, 3) and their pixels (N, 2) while the camera moves through POSE."""
    points = transform_points(POSE, landmarks_ahead(count, np.random.default_rng(2)))
    pixels, visible = rolling_pixels(CAMERA, points, constant_twist(POSE, twist), 0.0, readout_s)
    return points[visible], pixels[visible]


def error(fit: PoseFit) -> np.ndarray:
    return np.asarray(log_se3(inverse(POSE) @ fit.world_T_camera))


def test_a_point_is_seen_where_the_camera_is_by_then() -> None:
    points = landmarks_ahead(200, np.random.default_rng(1))
    times_s = np.linspace(-0.006, 0.006, len(points))
    exact = np.stack([
        transform_points(exp_se3(-t * TWIST), p[None])[0] for t, p in zip(times_s, points, strict=True)
    ])  # fmt: skip
    np.testing.assert_allclose(seen_later(points, TWIST, times_s), exact, atol=1e-5)
    assert np.abs(exact - points).max() > 0.05


def test_a_known_motion_gives_the_exact_pose() -> None:
    points, pixels = scene(300)
    start = POSE @ exp_se3(np.array([0.01, -0.01, 0.02, 0.03, -0.02, 0.01]))
    settings = PoseFitSettings()
    plain = fit_pose(CAMERA, points, pixels, start, settings, iterations=20)
    fit = fit_pose(CAMERA, points, pixels, start, settings, motion(READOUT_S, 0.0), iterations=20)
    assert np.linalg.norm(error(plain)[3:]) > 1e-3  # what it would cost
    assert np.abs(error(fit)).max() < 2e-5
    assert fit.inliers.all()
    # Without its shift every pixel is that of a camera that stands still.
    still, _ = CAMERA.project(transform_points(inverse(POSE), points))
    assert np.abs(pixels - fit.shifts - still).max() < 0.01


@pytest.mark.parametrize("true_s", [0.012, -0.012, 0.004, 0.0])
def test_a_known_twist_gives_the_readout_time(true_s: float) -> None:
    points, pixels = scene(300, readout_s=true_s)
    settings = PoseFitSettings()
    fit = fit_pose(CAMERA, points, pixels, POSE, settings, motion(0.0, 0.015, share=1e-3), iterations=20)
    assert fit.readout_time == pytest.approx(true_s, abs=2e-5)
    assert np.abs(error(fit)).max() < 1e-4
    assert fit.readout_information**-0.5 < 0.003


def test_jacobian_is_the_numeric_one() -> None:
    """The fit leaves out of the rows' own poses what the read-out turns them by: some per cent of a derivative."""
    points, pixels = scene(60)
    moving = replace(motion(0.01, 0.015), world_T_previous=POSE @ exp_se3(-0.03 * TWIST), gain=45.0, twist=-0.5 * TWIST)
    problem = Problem(CAMERA, points, pixels, PoseFitSettings(), moving)
    at = Point(POSE, np.array([0.1, -0.2, 0.05, 0.02, 0.03, -0.04]), 0.01)
    jacobian = problem.linearise(at, 100.0).jacobian
    assert jacobian.shape == (2 * len(points), 13)
    for column in range(13):
        step = np.zeros(13)
        step[column] = 1e-5
        ahead = problem.linearise(at.moved(step), 100.0).residuals
        behind = problem.linearise(at.moved(-step), 100.0).residuals
        numeric = (ahead - behind) / 2e-5
        assert np.linalg.norm(jacobian[:, column] - numeric) < 0.05 * np.linalg.norm(numeric), column
