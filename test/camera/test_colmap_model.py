"""Names and parameters that COLMAP understands."""

from collections.abc import Callable

import pycolmap
import pytest

from bodycam_ros.camera import CameraModel, colmap_model


@pytest.mark.parametrize(
    ("model", "d", "name", "distortion"),
    [
        ("plumb_bob", [], "OPENCV", [0, 0, 0, 0]),
        ("plumb_bob", [0.1, 0.2, 0.3, 0.4], "OPENCV", [0.1, 0.2, 0.3, 0.4]),
        ("plumb_bob", [0.1, 0.2, 0.3, 0.4, 0.5], "FULL_OPENCV", [0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0]),
        ("rational_polynomial", [0.1] * 8, "FULL_OPENCV", [0.1] * 8),
        ("equidistant", [0.1, 0.2, 0.3, 0.4], "OPENCV_FISHEYE", [0.1, 0.2, 0.3, 0.4]),
        ("fov", [0.9], "FOV", [0.9]),
    ],
)
def test_parameters_are_in_colmaps_order(
    make: Callable[..., CameraModel], model: str, d: list[float], name: str, distortion: list[float]
) -> None:
    camera = make(model, d, 300.0)
    found, params = colmap_model(camera)
    assert found == name
    assert params == pytest.approx([300.0, 303.0, 318.7, 244.2, *distortion])
    assert pycolmap.Camera(model=found, width=640, height=480, params=params).verify_params()
