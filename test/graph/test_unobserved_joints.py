"""What joint states have of unobserved joints."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body_state import BodyOutput, BodyState, BodyUncertainty
from bodycam_ros.errors import SettingsError
from bodycam_ros.graph.unobserved_joints import CHOICES, UnobservedJoints
from bodycam_ros.kinematics.joint_angles import JointAngles


def test_a_reader_can_tell_unobserved_joints(tmp_path: Path) -> None:
    body = read_body(write_body(tmp_path / "body.yaml"))
    names, poses = JointAngles(body).names, body.n_pose(np.eye(4))
    known = BodyUncertainty(np.eye(6), np.eye(6), np.eye(3)[None], np.tile(np.eye(6), (2, 1, 1)))
    state = BodyState(0, body.segments, poses, np.zeros((2, 6)), known, np.array([True, True]), 2)
    seen = BodyOutput(state, names, np.full(3, 0.1), np.full(3, 1.0))
    unseen = BodyOutput(replace(state, observed=np.array([True, False])), names, np.full(3, 0.2), np.full(3, 2.0))
    joints = {choice: UnobservedJoints(choice) for choice in CHOICES}
    for each in joints.values():
        given, positions, velocities = each.joint_states(seen, body)
        assert (given, positions.tolist(), velocities.tolist()) == (names, [0.1] * 3, [1.0] * 3)
    said = {choice: each.joint_states(unseen, body) for choice, each in joints.items()}
    assert said["predict"][1].tolist() == [0.2] * 3 and said["predict"][2].tolist() == [2.0] * 3
    assert said["hold"][0] == names and said["hold"][1].tolist() == [0.1] * 3 and np.isnan(said["hold"][2]).all()
    assert said["omit"][0] == () and not len(said["omit"][1]) and not len(said["omit"][2])
    with pytest.raises(SettingsError, match="unobserved_joints"):
        UnobservedJoints("guess")
