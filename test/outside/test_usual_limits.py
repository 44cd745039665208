"""Bodies that do not say how far they turn get what people do; those that say keep it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from outside.dressed_body import stations_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles, angle_limits
from bodycam_ros.geometry import exp_so3
from bodycam_ros.outside.articulated_step import ArticulatedStep, ExpectedBody
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.station_reports import StationReports
from bodycam_ros.outside.usual_limits import with_usual_limits
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.said_segments import SaidSegments


def without_limits(sample: Path) -> BodyModel:
    body = read_body(sample / "body.yaml")
    return replace(body, joints=tuple(replace(joint, limits=None) for joint in body.joints))


def test_what_a_body_says_stays(sample: Path) -> None:
    body = read_body(sample / "body.yaml")
    np.testing.assert_array_equal(angle_limits(with_usual_limits(body)), angle_limits(body))


def test_knees_bend_backwards_and_elbows_forwards(sample: Path) -> None:
    """In the N-pose x points forward and y left: a turn about y swings what hangs down backwards."""
    body = with_usual_limits(without_limits(sample))
    low, high = angle_limits(body)
    names = JointAngles(body).names
    knee, elbow = names.index("knee_left_y"), names.index("elbow_left_y")
    assert low[knee] > -0.3 and high[knee] > 2.0
    assert high[elbow] < 0.3 and low[elbow] < -2.0


def test_static_cameras_apply_them_to_any_body(sample: Path) -> None:
    body = without_limits(sample)
    surface = BodySurface.of(body, capsule_surfaces(body))
    tracker = RegionTracker(body, surface, stations_around(1), RegionSettings())
    np.testing.assert_array_equal(angle_limits(tracker.body), angle_limits(with_usual_limits(body)))
    poses, unlimited = spun(body, 1.0), ArticulatedStep(body)
    nothing_said = BodyFrame(1, {}, {}, {"a": SaidSegments("a", 1, (), {})})
    reports = StationReports(body, None, RegionSettings(), MotionSettings())
    seen = reports.look(nothing_said, poses, 1.0, ())
    assert seen is not None
    assert spin_of(body, seen.world_T_segment) < 0.5 < 0.99 < spin_of(body, unlimited.closed(poses))


def spun(body: BodyModel, turn_rad: float) -> NDArray[np.float64]:
    """Poses in the N-pose but for the left shin, turned about itself."""
    rotations = np.tile(np.eye(3), (len(body.tree_joints), 1, 1))
    rotations[shin_row(body)] = exp_so3(np.array([0.0, 0.0, turn_rad]))
    return body.forward_kinematics(np.eye(4), rotations)


def spin_of(body: BodyModel, poses: NDArray[np.float64]) -> float:
    return float(np.abs(np.arctan2(*body.joint_rotations(poses)[shin_row(body)][[1, 0], [0, 0]])))


def shin_row(body: BodyModel) -> int:
    return next(row for row, joint in enumerate(body.tree_joints) if joint.child == "shin_left")


def test_a_shin_does_not_spin(sample: Path) -> None:
    """Nothing tells its turn about itself; without limits it would stay where it has got to."""
    for body, is_held in ((without_limits(sample), False), (with_usual_limits(without_limits(sample)), True)):
        poses = spun(body, 1.0)
        nothing = np.zeros((len(poses), 6, 6)), np.zeros((len(poses), 6))
        step = ArticulatedStep(body)
        for _ in range(30):
            poses = step.moved(poses, *nothing, ExpectedBody(poses, np.full(6, 0.1), 0.1))
        assert spin_of(body, poses) < 0.15 if is_held else spin_of(body, poses) > 0.9
