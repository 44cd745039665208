"""Minutes of motion from seconds, and what they cost."""

import numpy as np
import pytest
from moving_body import STEP_NS, body_with_cameras, frame_after, lenses

from bodycam_ros.evaluate.endurance import endure, to_and_fro
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches


@pytest.fixture(scope="module")
def registered() -> list[LandmarkMatches]:
    """Two seconds."""
    body, rng = body_with_cameras(), np.random.default_rng(0)
    frames = [frame_after(body, number - 1, number, rng) for number in range(60)]
    return [matches for frame in frames for matches in frame.matches.values()]


def test_a_motion_goes_on_without_a_step_in_time_or_place(registered: list[LandmarkMatches]) -> None:
    chest = [matches for matches in to_and_fro(registered, 6.0) if matches.camera == "chest"]
    stamps = np.array([matches.stamp_ns for matches in chest])
    np.testing.assert_array_equal(np.diff(stamps), STEP_NS)
    assert stamps[-1] - stamps[0] > 5.9e9
    assert [matches.previous_stamp_ns for matches in chest[1:]] == stamps[:-1].tolist()
    poses = np.array([matches.world_T_camera for matches in chest])
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() < 0.1
    np.testing.assert_array_equal(poses[59:118], poses[59:0:-1])
    # What the images say of the turn is what the poses did, forward and backward.
    turned = np.swapaxes(poses[1:, :3, :3], 1, 2) @ poses[:-1, :3, :3]
    said = np.array([matches.current_R_previous for matches in chest[1:]])
    assert np.abs(turned - said).max() < 0.03


def test_every_instant_is_counted(registered: list[LandmarkMatches]) -> None:
    body = body_with_cameras()
    counted: list[int] = []
    endurance = endure(body, lenses(body), registered, PipelineSettings(), 9.0, on_instant=lambda: counted.append(1))
    # Clocks are listened to for the first second.
    assert len(counted) == len(endurance.solve_ms) == pytest.approx(8.0 / (1e-9 * STEP_NS), abs=5)
    assert 0.0 < endurance.percentile_ms(50) <= endurance.percentile_ms(99) <= endurance.percentile_ms(100)
    assert endurance.first_minute_ms == pytest.approx(endurance.solve_ms[endurance.stamps_s < 3.0].mean(), rel=0.1)
    assert endurance.last_minute_ms > 0.0 and endurance.memory_mb.min() > 10.0
