"""The robust fit of a camera's pose: exact landmarks, wrong ones, and the scatter that its information promises."""

import numpy as np
import pytest

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_se3, inverse, log_se3, transform_points
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose


@pytest.fixture(scope="module")
def camera() -> CameraModel:
    """The lens of the recordings: 153 degrees across."""
    k = [239.0, 0, 320.0, 0, 239.0, 240.0, 0, 0, 1]
    return camera_from_info("fisheye", 640, 480, "equidistant", [-0.0137, 0.0037, -0.0015, 0.0004], k)


WORLD_T_CAMERA = exp_se3(np.array([0.3, -1.2, 0.5, 2.0, -1.0, 1.4]))


def landmarks(count: int, seed: int = 0) -> np.ndarray:
    """World points (N, 3) within 70 degrees of the axis, 1 to 6 m away."""
    rng = np.random.default_rng(seed)
    angle, turn = np.radians(70) * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    distance = rng.uniform(1, 6, count)
    bearing = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    return transform_points(WORLD_T_CAMERA, bearing * distance[:, None])


def seen(camera: CameraModel, points_world: np.ndarray) -> np.ndarray:
    """Exact pixels of world points."""
    pixels, valid = camera.project(transform_points(inverse(WORLD_T_CAMERA), points_world))
    assert valid.all()
    return pixels


def error(fitted: np.ndarray) -> np.ndarray:
    """Tangent vector from the true pose to the fitted one."""
    return log_se3(inverse(WORLD_T_CAMERA) @ fitted)


def test_exact_landmarks_give_the_exact_pose(camera: CameraModel) -> None:
    points = landmarks(40)
    start = WORLD_T_CAMERA @ exp_se3(np.array([0.02, -0.03, 0.01, 0.05, 0.02, -0.04]))
    fit = fit_pose(camera, points, seen(camera, points), start, PoseFitSettings(), iterations=20)
    assert np.abs(error(fit.world_T_camera)).max() < 1e-6
    assert fit.inliers.all()


def test_forty_per_cent_of_wrong_landmarks_hardly_move_it_and_are_named(camera: CameraModel) -> None:
    points = landmarks(100)
    pixels = seen(camera, points)
    rng = np.random.default_rng(3)
    wrong = np.arange(100) < 40
    pixels[wrong] += rng.uniform(15, 60, (40, 2)) * rng.choice([-1, 1], (40, 2))
    start = WORLD_T_CAMERA @ exp_se3(np.array([0.01, -0.01, 0.01, 0.02, 0.02, -0.02]))
    fit = fit_pose(camera, points, pixels, start, PoseFitSettings(), iterations=30)
    assert np.array_equal(fit.inliers, ~wrong)
    assert np.linalg.norm(error(fit.world_T_camera)[3:]) < 1e-3


def test_information_predicts_the_scatter_of_the_pose(camera: CameraModel) -> None:
    points, rng = landmarks(80), np.random.default_rng(4)
    settings, wide = PoseFitSettings(pixel_sigma=0.5), {"inlier_px": 20.0, "iterations": 15}
    pixels = seen(camera, points)
    fits = [
        fit_pose(camera, points, pixels + 0.5 * rng.standard_normal(pixels.shape), WORLD_T_CAMERA, settings, **wide)
        for _ in range(300)
    ]
    errors = np.array([error(fit.world_T_camera) for fit in fits])
    # Squared errors in units of their covariance are chi-square with 6 degrees of freedom: mean 6.
    normalised = np.einsum("ni,nij,nj->n", errors, np.array([fit.information for fit in fits]), errors)
    assert normalised.mean() == pytest.approx(6.0, rel=0.15)
