"""Bodies that do not say how far they turn get what people do; those that say keep it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles, angle_limits
from bodycam_ros.geometry import exp_so3
from bodycam_ros.outside.articulated_step import ArticulatedStep, ExpectedBody
from bodycam_ros.outside.usual_limits import with_usual_limits


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


def test_a_shin_does_not_spin(sample: Path) -> None:
    """Nothing tells its turn about itself; without limits it would stay where it has got to."""
    for body, is_held in ((without_limits(sample), False), (with_usual_limits(without_limits(sample)), True)):
        rotations = np.tile(np.eye(3), (len(body.tree_joints), 1, 1))
        row = next(row for row, joint in enumerate(body.tree_joints) if joint.child == "shin_left")
        rotations[row] = exp_so3(np.array([0.0, 0.0, 1.0]))
        poses = body.forward_kinematics(np.eye(4), rotations)
        nothing = np.zeros((len(poses), 6, 6)), np.zeros((len(poses), 6))
        step = ArticulatedStep(body)
        for _ in range(30):
            poses = step.moved(poses, *nothing, ExpectedBody(poses, np.full(6, 0.1), 0.1))
        spun = float(np.abs(np.arctan2(*body.joint_rotations(poses)[row][[1, 0], [0, 0]])))
        assert spun < 0.15 if is_held else spun > 0.9
