"""The mask of the view is that of asking every pixel, to the pixel."""

import numpy as np
import pytest

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.tracking.feature_tracker import view_mask

LENSES = {
    "pinhole": ("plumb_bob", [], 525.0),
    "plumb_bob": ("plumb_bob", [-0.28, 0.09, 4e-3, -3e-3, -0.01], 180.0),
    "rational_polynomial": ("rational_polynomial", [0.46, -2.6, 1e-3, -4e-4, 1.5, 0.33, -2.4, 1.44], 220.0),
    "equidistant_170": ("equidistant", [0.03, -0.012, 0.004, -6e-4], 212.0),
    "equidistant_200": ("equidistant", [0.01, -0.002, 4e-4, -2e-5], 150.0),
    "short_cone": ("equidistant", [-0.2, 0, 0, 0], 200.0),
    "fov": ("fov", [0.95], 205.0),
    "fov_wide": ("fov", [1.5], 120.0),
}


def asked(camera: CameraModel, max_view_angle_deg: float) -> np.ndarray:
    """What the mask is: every pixel unprojected."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    bearings, valid = camera.unproject(np.column_stack([columns.ravel(), rows.ravel()]))
    seen = valid & (bearings[:, 2] > np.cos(np.radians(max_view_angle_deg)))
    return np.where(seen, 255, 0).reshape(camera.height, camera.width)


@pytest.mark.parametrize("lens", LENSES)
def test_the_rim_is_exact_to_the_pixel(lens: str) -> None:
    model, d, f = LENSES[lens]
    cut = 0
    for cx, cy in ((158.2, 123.7), (10.0, 235.0)):
        camera = camera_from_info("c", 320, 240, model, d, [0.5 * f, 0, cx, 0, 0.515 * f, cy, 0, 0, 1])
        for angle_deg in (20.0, 60.0, 86.0, 110.0):
            mask, expected = view_mask(camera, angle_deg), asked(camera, angle_deg)
            assert mask.dtype == np.uint8
            np.testing.assert_array_equal(mask, expected)
            cut += 0 < expected.mean() < 255
    assert cut >= 2
