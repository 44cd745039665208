"""The compiled pose fit is the one in NumPy."""

import numpy as np
import pytest
from helpers.numpy_pose_fit import fit_pose_in_numpy, seen_later

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_se3, transform_points
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose, row_shares
from bodycam_ros.tracking.camera_motion import ImageMotion

LENSES = {
    "equidistant": [-0.0137, 0.0037, -0.0015, 0.0004],
    "plumb_bob": [-0.05, 0.01, 4e-4, -3e-4, 0.0],
    "fov": [0.95],
}
WORLD_T_CAMERA = exp_se3(np.array([0.3, -1.2, 0.5, 2.0, -1.0, 1.4]))
TWIST = np.array([2.0, -3.0, 1.0, 0.5, -1.0, 0.7])


@pytest.fixture(params=LENSES)
def camera(request: pytest.FixtureRequest) -> CameraModel:
    k = [239.0, 0, 320.0, 0, 239.0, 240.0, 0, 0, 1]
    return camera_from_info("c", 640, 480, request.param, LENSES[request.param], k)


def motion(readout_time: float, readout_sigma: float) -> ImageMotion:
    """The motion of a camera that moves a little differently than it did before."""
    sigmas = np.repeat([0.5, 0.2], 3)
    previous = WORLD_T_CAMERA @ exp_se3(-0.03 * TWIST)
    return ImageMotion(
        readout_time, readout_sigma, previous, np.repeat([12.0, 20.0], 3), 0.35 * TWIST, sigmas, TWIST[:3]
    )


def measured(camera: CameraModel, count: int, readout_time: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """World points (N, 3), and where a moving camera sees them (N, 2): with noise, and a fifth of them wrong."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-1.5, -1.5, 0.8], [1.5, 1.5, 4.0], (count, 3))
    pixels = camera.project(points)[0]
    for _ in range(5):
        times_s = readout_time * row_shares(camera, pixels)
        pixels = camera.project(seen_later(points, TWIST, times_s))[0]
    pixels += rng.normal(0.0, 0.6, pixels.shape)
    pixels[: count // 5] += rng.uniform(10.0, 40.0, (count // 5, 2))
    return transform_points(WORLD_T_CAMERA, points), pixels


def compare(ours: PoseFit, theirs: PoseFit) -> None:
    np.testing.assert_allclose(ours.world_T_camera, theirs.world_T_camera, atol=1e-11)
    scale = np.abs(theirs.information).max() + 1e-9
    np.testing.assert_allclose(ours.information / scale, theirs.information / scale, atol=1e-11)
    np.testing.assert_allclose(ours.errors_px, theirs.errors_px, atol=1e-9)
    np.testing.assert_array_equal(ours.inliers, theirs.inliers)
    np.testing.assert_allclose(ours.shifts, theirs.shifts, atol=1e-9)
    assert ours.readout_time == pytest.approx(theirs.readout_time, rel=1e-9, abs=1e-12)
    assert ours.readout_information == pytest.approx(theirs.readout_information, rel=1e-9)


@pytest.mark.parametrize(
    ("readout_time", "readout_sigma"), [(0.0, 0.0), (0.012, 0.0), (-0.02, 0.003), (0.0, 0.005)], ids=str
)
def test_fits_are_equal(camera: CameraModel, readout_time: float, readout_sigma: float) -> None:
    for seed, count in enumerate([6, 14, 15, 40, 41, 120]):
        points, pixels = measured(camera, count, readout_time, seed)
        start = WORLD_T_CAMERA @ exp_se3(np.array([0.01, -0.008, 0.012, 0.02, 0.02, -0.03]))
        for iterations in (1, 6, 30):
            arguments = (camera, points, pixels, start, PoseFitSettings())
            moving = motion(readout_time, readout_sigma)
            ours = fit_pose(*arguments, moving, iterations=iterations)
            compare(ours, fit_pose_in_numpy(*arguments, moving, iterations))
    assert (ours.readout_information > 0.0) == (readout_sigma > 0.0)


def test_what_is_out_of_view_or_too_little_is_dealt_with_alike(camera: CameraModel) -> None:
    points, pixels = measured(camera, 30, 0.0, 1)
    behind = transform_points(WORLD_T_CAMERA, np.array([[0.1, 0.1, -2.0], [0.3, 0.1, -2.0], [0.1, 0.4, -3.0]]))
    for some in (points, behind, np.vstack([points, behind]), points[:6]):
        at = np.full((len(some), 2), 100.0)
        at[: min(len(some), 30)] = pixels[: min(len(some), 30)]
        for moving in (None, motion(0.012, 0.003)):
            arguments = (camera, some, at[: len(some)], WORLD_T_CAMERA, PoseFitSettings(), moving)
            compare(fit_pose(*arguments), fit_pose_in_numpy(*arguments))
    fit = fit_pose(camera, np.zeros((0, 3)), np.zeros((0, 2)), WORLD_T_CAMERA, PoseFitSettings())
    np.testing.assert_array_equal(fit.world_T_camera, WORLD_T_CAMERA)
    assert len(fit.errors_px) == 0 and not fit.information.any()
