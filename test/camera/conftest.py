"""Cameras of every model, with the distortion of real lenses."""

from collections.abc import Callable

import numpy as np
import pytest

from bodycam_ros.camera import CameraModel, camera_from_info

_LENSES = {
    "pinhole": ("plumb_bob", [], 525.0),
    "plumb_bob": ("plumb_bob", [-0.28, 0.09, 4e-4, -3e-4, -0.01], 480.0),
    "rational_polynomial": ("rational_polynomial", [0.46, -2.6, 1e-3, -4e-4, 1.5, 0.33, -2.4, 1.44], 420.0),
    "equidistant_170": ("equidistant", [0.03, -0.012, 0.004, -6e-4], 212.0),
    "equidistant_200": ("equidistant", [0.01, -0.002, 4e-4, -2e-5], 190.0),
    "fov_170": ("fov", [0.95], 205.0),
}


@pytest.fixture(params=_LENSES)
def lens(request: pytest.FixtureRequest) -> CameraModel:
    """One camera of each kind; all pixels of its image are inside the valid cone."""
    return make_camera(*_LENSES[request.param])


@pytest.fixture
def make() -> Callable[..., CameraModel]:
    """Make a 640x480 camera: ``make(distortion_model, d, f)``."""
    return make_camera


@pytest.fixture
def cone() -> Callable[..., np.ndarray]:
    """Points about the axis: ``cone(angles)``, at distances of 0.2 to 30 m and in all directions."""
    return points_at


def make_camera(distortion_model: str, d: list[float], f: float) -> CameraModel:
    return camera_from_info("waist_front", 640, 480, distortion_model, d, [f, 0, 318.2, 0, f * 1.01, 243.7, 0, 0, 1])


def points_at(angles: np.ndarray) -> np.ndarray:
    """Points (N, 3) at the angles (N,) to the axis [rad], in varied directions and distances."""
    direction = np.arange(len(angles)) * 2.4
    distance = np.geomspace(0.2, 30.0, len(angles))
    sin = np.sin(angles)
    return distance[:, None] * np.column_stack([sin * np.cos(direction), sin * np.sin(direction), np.cos(angles)])
