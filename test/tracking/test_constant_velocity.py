"""A camera that keeps its velocity is predicted where it will be, however many images are missing in between."""

import numpy as np
import pytest

from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.tracking.camera_motion import LONGEST_NS, CameraMotion

FRAME_NS = 33_333_333
PER_FRAME = np.array([0.02, -0.05, 0.01, 0.05, 0.0, 0.0])  # 1.5 m/s at 30 Hz
FIRST = exp_se3(np.array([0.3, -0.1, 0.8, 1.0, 2.0, 1.5]))


def predicted(passed_ns: int) -> Array:
    first = CameraMotion().with_pose(0, FIRST, 0)
    pose = first.with_pose(FRAME_NS, FIRST @ exp_se3(PER_FRAME), 0).predict(passed_ns)
    assert pose is not None
    return pose


@pytest.mark.parametrize("missing", [0, 1, 2, 5])
def test_missing_images_count(missing: int) -> None:
    expected = FIRST @ exp_se3((2 + missing) * PER_FRAME)
    np.testing.assert_allclose(predicted((1 + missing) * FRAME_NS), expected, atol=1e-9)


def test_nobody_keeps_a_velocity_for_long() -> None:
    expected = FIRST @ exp_se3((1.0 + LONGEST_NS / FRAME_NS) * PER_FRAME)
    np.testing.assert_allclose(predicted(60 * 10**9), expected, atol=1e-9)
