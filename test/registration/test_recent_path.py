"""What the latest registered images of a camera tell of its motion."""

import numpy as np
import pytest

from bodycam_ros.camera.readout import Readout
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_se3
from bodycam_ros.registration.readout_time import ReadoutTime, ShutterSettings
from bodycam_ros.registration.recent_path import RecentPath, RegisteredView
from bodycam_ros.tracking.track_frame import TrackFrame

START = exp_se3(np.array([0.3, -0.5, 0.2, 1.0, 2.0, 0.5]))
TWIST = np.array([2.0, -1.0, 0.5, 0.4, -0.8, 0.3])
SETTINGS = ShutterSettings()
READOUT = ReadoutTime(SETTINGS, Readout(0.012, 0.0))
NS = 1_000_000_000


def path_of(times: list[float], turning: float = 0.0) -> RecentPath:
    """Images of a camera of a constant twist that grows by ``turning`` rad/s^2 about y."""
    path, before = RecentPath(SETTINGS), 0
    for seconds in times:
        pose = START @ exp_se3(seconds * TWIST)
        pose[:3, :3] = pose[:3, :3] @ exp_so3(0.5 * turning * seconds**2 * np.array([0.0, 1.0, 0.0]))
        view = RegisteredView(round(NS * seconds) + NS, pose, np.zeros((0, 3)), np.zeros((0, 2)))
        path.add(view, before)
        before = view.stamp_ns
    return path


def frame(seconds: float, previous: float, inliers: int = 0) -> TrackFrame:
    turn = exp_so3((seconds - previous) * TWIST[:3]).T
    none = np.zeros(0, np.uint32)
    stamps = round(NS * seconds) + NS, round(NS * previous) + NS
    return TrackFrame("c", *stamps, none, np.zeros((0, 2), np.float32), none, np.zeros((0, 128), np.uint8),
                      np.zeros(0, np.float32), False, turn, inliers)  # fmt: skip


def stamped(tracks: TrackFrame) -> tuple[int, int, TrackFrame]:
    """As ``RecentPath.motion`` takes a frame."""
    return tracks.stamp_ns, tracks.previous_stamp_ns, tracks


def test_a_constant_twist_is_told_at_any_spacing() -> None:
    motion = path_of([0.0, 0.033, 0.08]).motion(*stamped(frame(0.12, 0.08)), READOUT)
    assert motion is not None and motion.readout_time == 0.012 and motion.readout_sigma == 0.0
    np.testing.assert_allclose(motion.twist_at(START @ exp_se3(0.12 * TWIST)), TWIST, atol=1e-6)


def test_a_missing_image_ends_the_path() -> None:
    path = path_of([0.0, 0.033, 0.066])
    assert path.motion(*stamped(frame(0.2, 0.1)), READOUT) is None
    path.add(RegisteredView(2 * NS, START, np.zeros((0, 3)), np.zeros((0, 2))), 2 * NS - 1)
    assert path.between(READOUT) is None


@pytest.mark.parametrize("times", [[0.0, 0.033, 0.066], [0.0, 0.02, 0.066]])
def test_the_image_between_is_told_from_both_sides(times: list[float]) -> None:
    between = path_of(times, turning=40.0).between(READOUT)
    assert between is not None
    view, motion = between
    assert view.stamp_ns == round(NS * times[1]) + NS
    ahead, behind = (path_of([times[1] + step], 40.0)._views[0].world_T_camera for step in (1e-4, -1e-4))
    true = log_se3(inverse(behind) @ ahead) / 2e-4
    np.testing.assert_allclose(motion.twist, true, atol=0.03)
    # What the two steps differ by may have come at once.
    assert motion.sigmas[1] > 3.0 * motion.sigmas[0]
