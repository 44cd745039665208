"""A camera that keeps its velocity is predicted where it will be, however many images are missing in between."""

import numpy as np
import pytest

from bodycam_ros.geometry import exp_se3
from bodycam_ros.tracking.camera_motion import LONGEST_NS, camera_velocity, predict_pose

FRAME_NS = 33_333_333


@pytest.mark.parametrize("missing", [0, 1, 2, 5])
def test_missing_images_count(missing: int) -> None:
    per_frame = np.array([0.02, -0.05, 0.01, 0.05, 0.0, 0.0])  # 1.5 m/s at 30 Hz
    first = exp_se3(np.array([0.3, -0.1, 0.8, 1.0, 2.0, 1.5]))
    latest = first @ exp_se3(per_frame)
    velocity = camera_velocity(first, latest, FRAME_NS)
    predicted = predict_pose(latest, velocity, (1 + missing) * FRAME_NS)
    np.testing.assert_allclose(predicted, latest @ exp_se3((1 + missing) * per_frame), atol=1e-9)


def test_nobody_keeps_a_velocity_for_long() -> None:
    velocity = np.array([0.0, 0.0, 0.0, 1.5, 0.0, 0.0])
    assert predict_pose(np.eye(4), velocity, 60 * 10**9)[0, 3] == pytest.approx(1.5e-9 * LONGEST_NS)
