"""The N-pose: how long it was held, and which way the person faced."""

import numpy as np
import pytest

from bodycam_ros.calibration.rest_pose import RestPoseSettings, facing_direction, find_rest_pose, heading_rotation
from bodycam_ros.geometry import exp_so3, rigid

SECONDS = np.arange(120) / 30.0
SETTINGS = RestPoseSettings()


def swinging(begin_s: float) -> np.ndarray:
    angle = np.maximum(SECONDS - begin_s, 0.0)
    return rigid(exp_so3(angle[:, None] * [0.0, 1.0, 0.0]), np.zeros(3))


def find(poses: dict[str, np.ndarray], known: dict[str, np.ndarray] | None = None):
    return find_rest_pose(SECONDS, poses, known or {s: np.ones(120, bool) for s in poses}, SETTINGS)


def test_it_ends_with_the_first_segment_that_moves() -> None:
    rest = find({"thigh": swinging(2.0), "arm": swinging(1.5)})
    assert SECONDS[rest.instants[-1]] == pytest.approx(1.5 + SETTINGS.max_turn, abs=0.05)
    np.testing.assert_allclose(rest.world_T_segment["thigh"], np.eye(4), atol=1e-6)


@pytest.mark.parametrize("heading", [-3.0, -0.4, 0.0, 1.2])
def test_facing_is_across_hips_and_shoulders(heading: float) -> None:
    R = heading_rotation(heading)
    joints = {
        "hip_left": R @ [0.0, 0.09, 0.9],
        "hip_right": R @ [0.0, -0.09, 0.9],
        "shoulder_left": R @ [0.01, 0.2, 1.4],
        "shoulder_right": R @ [0.01, -0.2, 1.38],
        "neck": R @ [0.0, 0.0, 1.5],
    }
    assert facing_direction(joints, RestPoseSettings()) == pytest.approx(heading, abs=1e-9)
