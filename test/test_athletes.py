"""That the athletes are people who hold on to what they ride: else they would prove nothing."""

from collections.abc import Callable

import numpy as np
import pytest
from athletes import AIRBORNE_S, CRANK_M, RATE_HZ, Athlete, cyclist, lifter, snowboarder

from bodycam_ros.geometry import inverse, log_so3

ATHLETES = [cyclist, snowboarder, lifter]


@pytest.mark.parametrize("made", ATHLETES)
def test_no_joint_gapes_and_every_attachment_holds(made: Callable[[], Athlete]) -> None:
    athlete = made()
    body, equipment = athlete.body, athlete.equipment
    hung = body.forward_kinematics(athlete.poses[:, body.segment_index["pelvis"]], body.joint_rotations(athlete.poses))
    np.testing.assert_allclose(hung, athlete.poses, atol=1e-9)
    rows = {segment: row for row, segment in enumerate(equipment.segments)}
    for attachment in equipment.attachments:
        mine = athlete.poses[:, body.segment_index[attachment.body_segment]]
        its = athlete.equipment_poses[:, rows[attachment.equipment_segment]]
        apart = [attachment.distances(a, b).max() for a, b in zip(mine, its, strict=True)]
        assert max(apart) < (0.006 if attachment.name == "saddle" else 1e-9), attachment.name
    for joint in equipment.joints:
        parent, child = (athlete.equipment_poses[:, rows[name]] for name in (joint.parent, joint.child))
        parent_T_child = inverse(parent) @ child
        np.testing.assert_allclose(joint.measured_relative_pose(parent_T_child), parent_T_child, atol=1e-9)


@pytest.mark.parametrize("made", ATHLETES)
def test_no_knee_or_elbow_bends_the_wrong_way(made: Callable[[], Athlete]) -> None:
    athlete = made()
    turns = log_so3(athlete.body.joint_rotations(athlete.poses))
    for row, joint in enumerate(athlete.body.tree_joints):
        if joint.name.startswith(("knee", "elbow")):
            bent = turns[:, row, 1] * (1.0 if joint.name.startswith("knee") else -1.0)
            assert (bent > 0.05).all() and (bent < 2.4).all(), (joint.name, bent.min(), bent.max())


def test_the_cyclist_turns_the_crank_and_sways_little() -> None:
    athlete = cyclist(cadence_rpm=60.0)
    crank = athlete.equipment_poses[:, 1]
    left = athlete.equipment_poses[:, 2]
    np.testing.assert_allclose(np.linalg.norm((left - crank)[:, :3, 3], axis=1), np.hypot(CRANK_M, 0.125), atol=1e-12)
    quarter = round(0.25 * RATE_HZ)
    turned = log_so3(np.swapaxes(crank[:-quarter, :3, :3], 1, 2) @ crank[quarter:, :3, :3])
    np.testing.assert_allclose(turned[:, 1], 2.0 * np.pi * quarter / RATE_HZ, atol=1e-9)
    assert np.ptp(athlete.poses[:, athlete.body.segment_index["pelvis"], :3, 3], axis=0).max() < 0.005


def test_the_snowboarder_flies_and_turns_round() -> None:
    athlete = snowboarder()
    board = athlete.equipment_poses[:, 0]
    flying = (athlete.times > AIRBORNE_S[0]) & (athlete.times < AIRBORNE_S[1])
    assert 0.15 < board[flying, 2, 3].max() < 0.25 and board[~flying, 2, 3].max() < 0.04
    assert (board[0, :3, 0] @ board[-1, :3, 0]) < -0.9
