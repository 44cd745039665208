"""How finely a lens shows what is there, against what neighbouring bearings do."""

import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.camera.local_scale import local_scales

LENSES = {
    "equidistant": [-0.0137, 0.0037, -0.0015, 0.0004],
    "plumb_bob": [-0.05, 0.01, 0.0, 0.0, 0.0],
    "rational_polynomial": [0.1, -0.02, 0.0, 0.0, 0.01, 0.2, 0.0, 0.0],
    "fov": [0.95],
}


@pytest.mark.parametrize("model", LENSES)
@pytest.mark.parametrize("angle_deg", [0.0, 12.0, 33.0, 50.0])
def test_it_is_how_far_apart_neighbouring_directions_are_shown(model: str, angle_deg: float) -> None:
    camera = camera_from_info("c", 640, 480, model, LENSES[model], [239.0, 0, 320.0, 0, 241.0, 240.0, 0, 0, 1])
    scales = local_scales(camera)
    angle, step = np.radians(angle_deg), 1e-5
    ahead = np.array([np.sin(angle), 0.0, np.cos(angle)])
    along = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    across = np.array([0.0, 1.0, 0.0])
    pixels = camera.project(ahead + step * np.array([along, -along, across, -across]))[0]
    expected = np.sqrt(abs(np.linalg.det([pixels[0] - pixels[1], pixels[2] - pixels[3]]))) / (2.0 * step)
    nearest = scales[round((np.cos(angle) + 1.0) / 2.0 * (len(scales) - 1))]
    assert nearest == pytest.approx(expected, rel=0.03)
