"""Landmarks are chosen as NumPy chooses them: in view, facing the camera, trusted, spread over the image."""

import numpy as np
import pytest
from helpers.numpy_patches import best_views_in_numpy, choose_in_numpy
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.local_scale import local_scales, radial_gains
from bodycam_ros.geometry import exp_se3, transform_points
from bodycam_ros.registration.landmark_choice_kernels import best_views, choose_landmarks

LENSES = {
    "equidistant": [-0.0137, 0.0037, -0.0015, 0.0004],
    "plumb_bob": [-0.05, 0.01, 4e-4, -3e-4, 0.0],
    "fov": [0.95],
}
POSE = exp_se3(np.array([0.3, -1.2, 0.5, 2.0, -1.0, 1.4]))
STILL = np.zeros(6)
TWIST = np.array([2.0, -3.0, 1.0, 0.5, -1.0, 0.7])
CENTRE = POSE[:3, 3].copy()


@pytest.fixture(params=LENSES)
def camera(request: pytest.FixtureRequest) -> CameraModel:
    k = [239.0, 0, 320.0, 0, 239.0, 240.0, 0, 0, 1]
    return camera_from_info("c", 640, 480, request.param, LENSES[request.param], k)


def landmarks(count: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]:
    """Points all around the camera, with normals and sizes of all kinds."""
    random = np.random.default_rng(seed)
    points = transform_points(POSE, random.normal(size=(count, 3)) * 2.0 + np.array([0.0, 0.0, 1.0]))
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points, normals.astype(np.float32), random.uniform(0.002, 0.08, count).astype(np.float32)


@pytest.mark.parametrize(("twist", "readout_time"), [(STILL, 0.0), (TWIST, 0.012), (TWIST, -0.02)])
def test_chooses_what_numpy_chooses(camera: CameraModel, twist: NDArray[np.float64], readout_time: float) -> None:
    points, normals, sizes = landmarks(3000)
    surfaces = np.concatenate([points.T, normals.T, sizes[None]]).astype(np.float32)
    trust = np.random.default_rng(1).uniform(0.0, 1.0, len(points)).astype(np.float32)
    for per_cell in (1, 2, 5):
        rows = choose_landmarks(
            camera.parameters, radial_gains(camera), POSE, twist, readout_time, surfaces, trust, per_cell
        )
        expected = choose_in_numpy(camera, POSE, twist, readout_time, points, normals, sizes, trust, per_cell)
        np.testing.assert_array_equal(rows, expected)
        assert len(rows) > 8


PHOTOGRAPHERS = [
    camera_from_info("p", 800, 600, "plumb_bob", [0.02, -0.01, 0, 0], [400.0, 0, 400, 0, 401, 300, 0, 0, 1]),
    camera_from_info("f", 640, 480, "equidistant", [-0.1, 0.0, 0.0, 0.0], [239.0, 0, 320, 0, 239, 240, 0, 0, 1]),
    camera_from_info("v", 640, 480, "fov", LENSES["fov"], [239.0, 0, 320.0, 0, 239.0, 240.0, 0, 0, 1]),
]


def test_the_view_is_that_of_numpy(camera: CameraModel) -> None:
    points, _, _ = landmarks(200)
    random = np.random.default_rng(3)
    poses = exp_se3(random.normal(size=(12, 6)))
    poses[:, :3, 3] = CENTRE + random.normal(size=(12, 3)) * 2.0
    of_view = random.integers(0, 3, 12).astype(np.uint16)
    observers = [sorted(random.choice(12, random.integers(0, 6), replace=False).tolist()) for _ in points]
    first = np.concatenate([[0], np.cumsum([len(seers) for seers in observers])])
    flat = np.array([view for seers in observers for view in seers], np.uint16)
    rows = random.permutation(200)[:150]
    scales = np.stack([local_scales(photographer) for photographer in PHOTOGRAPHERS])
    views = best_views(local_scales(camera), POSE, points, rows, scales, of_view, poses, first, flat)
    photographers = [PHOTOGRAPHERS[c] for c in of_view]
    np.testing.assert_array_equal(
        views, best_views_in_numpy(camera, POSE, points, rows, photographers, poses, observers)
    )
    assert (views == -1).any() and len(set(views.tolist())) > 8
