"""Steps of a body whose joints are closed, against differences of the body itself."""

from dataclasses import replace

import numpy as np
from helpers.known_walk import Walk
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3, inverse, log_se3, log_so3, rigid
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody

Array = NDArray[np.float64]


def poses_of(body: BodyModel, seed: int) -> Array:
    """Closed, all joints turned, far from the world's origin."""
    random = np.random.default_rng(seed)
    root = rigid(exp_so3(random.normal(0.0, 1.0, 3)), np.array([3.0, -2.0, 1.0]))
    turned = exp_so3(random.normal(0.0, 0.4, (len(body.tree_joints), 3)))
    shut = body.joint_rotations(body.forward_kinematics(root, turned))
    return body.forward_kinematics(root, shut)


def nothing_expected(poses: Array) -> PredictedBody:
    return PredictedBody(poses, np.full(6, 1e4), 1e4)


def segment_changes(before: Array, after: Array) -> Array:
    """(S, 6) in the segments' axes, rotation first."""
    return np.array([log_se3(inverse(a) @ b) for a, b in zip(before, after, strict=True)])


def test_what_segments_hold_each_other_by_stays_closed(rider: BodyModel) -> None:
    random = np.random.default_rng(2)
    step, poses = ArticulatedStep(rider), poses_of(rider, 3)
    information = np.tile(1e4 * np.eye(6), (len(rider.segments), 1, 1))
    moved = step.apply(poses, information, random.normal(0.0, 2e3, (len(rider.segments), 6)), nothing_expected(poses))
    assert np.abs(segment_changes(poses, moved)).max() > 0.05
    for joint in rider.tree_joints:
        parent, child = (moved[rider.segment_index[segment]] for segment in (joint.parent, joint.child))
        gap = inverse(parent @ joint.parent_T_joint) @ child @ joint.child_T_joint
        np.testing.assert_allclose(gap[:3, 3], 0.0, atol=1e-12)
        turn = gap[:3, :3]
        if joint.type == "hinge":
            np.testing.assert_allclose(turn @ joint.axis, joint.axis, atol=1e-12)
        if joint.type == "weld":
            np.testing.assert_allclose(turn, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(step.close_joints(moved), moved, atol=1e-12)


def test_exact_information_at_all_segments_leads_to_the_truth(walk: Walk) -> None:
    body, truth = walk.body, walk.world_T_segment[10]
    step, poses = ArticulatedStep(body), walk.world_T_segment[3]
    assert np.abs(segment_changes(poses, truth)).max() > 0.2
    information = np.tile(1e4 * np.eye(6), (len(poses), 1, 1))
    errors = []
    for _ in range(8):
        changes = segment_changes(poses, truth)
        errors.append(float(np.abs(changes).max()))
        poses = step.apply(poses, information, (information @ changes[..., None])[..., 0], nothing_expected(poses))
    assert np.abs(segment_changes(poses, truth)).max() < 1e-7
    assert errors[3] < 0.02 * errors[0]


def limited(body: BodyModel, name: str, limits: tuple[tuple[float, float], ...]) -> BodyModel:
    joints = [replace(joint, limits=limits if joint.name == name else None) for joint in body.joints]
    return replace(body, joints=tuple(joints))


def test_a_joint_beyond_its_limits_is_drawn_back_to_them(walk: Walk) -> None:
    """Those within are drawn to the middle of the range much less, and others are left alone."""
    hip = [joint.name for joint in walk.body.tree_joints].index("hip_left")
    body = limited(walk.body, "hip_left", ((-0.3, 0.3), (-0.4, 0.4), (-0.5, 0.5)))
    count = len(body.tree_joints)
    nothing = np.zeros((count + 1, 6, 6)), np.zeros((count + 1, 6))
    for angle, least, most in ((0.9, 0.2, 0.45), (0.2, 0.05, 0.2), (-0.7, -0.45, -0.15)):
        turned = np.tile(exp_so3(np.array([0.1, 0.0, 0.0])), (count, 1, 1))
        turned[hip] = exp_so3(np.array([0.0, angle, 0.0]))
        poses = body.forward_kinematics(np.eye(4), body.joint_rotations(body.forward_kinematics(np.eye(4), turned)))
        before = body.joint_rotations(poses)
        for _ in range(8):
            poses = ArticulatedStep(body).apply(poses, *nothing, PredictedBody(poses, np.full(6, 1e-3), 0.05))
        after = body.joint_rotations(poses)
        np.testing.assert_allclose(log_so3(after[hip])[[0, 2]], 0.0, atol=0.01)
        assert least < log_so3(after[hip])[1] < most
        others = np.arange(count) != hip
        np.testing.assert_allclose(after[others], before[others], atol=1e-6)
