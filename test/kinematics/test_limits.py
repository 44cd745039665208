from dataclasses import replace

import numpy as np
from helpers.known_motion import BODY

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3
from bodycam_ros.kinematics.joint_angles import JointAngles, JointLimits


def with_a_hinge() -> BodyModel:
    """The sample's body, its left knee a hinge."""
    joints = (
        replace(joint, type="hinge", axis=np.array([0.0, 1.0, 0.1]), limits=((-0.1, 1.7),))
        if joint.name == "knee_left"
        else joint
        for joint in BODY.joints
    )
    return replace(BODY, joints=tuple(joints))


def motion_of(body: BodyModel, angles: dict[str, float]) -> np.ndarray:
    names = JointAngles(body).names
    motion = np.tile(np.eye(4), (len(body.tree_joints), 1, 1))
    motion[:, :3, :3] = JointAngles(body).rotations(np.array([angles.get(name, 0.0) for name in names]))
    return motion


def test_excess_is_how_far_angles_are_beyond() -> None:
    body = with_a_hinge()
    limits = JointLimits(body)
    assert not limits.excess(limits.nearest_angles(motion_of(body, {}))).any()
    beyond = motion_of(body, {"knee_left": 2.0, "knee_right_y": 1.0, "hip_left_y": -1.5})
    excess = dict(zip(limits.angles.names, limits.excess(limits.nearest_angles(beyond)), strict=True))
    hip = next(joint for joint in body.joints if joint.name == "hip_left")
    assert hip.limits is not None
    expected = {"knee_left": 0.3, "hip_left_y": -1.5 - hip.limits[0][0]}
    for name, value in excess.items():
        np.testing.assert_allclose(value, expected.get(name, 0.0), atol=1e-9)
    clamped = limits.nearest_angles(limits.clamp(beyond[:, :3, :3]))
    np.testing.assert_allclose(limits.excess(clamped), 0.0, atol=1e-9)
    assert limits.excess(limits.nearest_angles(beyond)).any()


def test_rates_are_the_numeric_ones() -> None:
    body = with_a_hinge()
    limits, angles = JointLimits(body), JointAngles(body)
    motion = motion_of(body, {"knee_left": -0.5, "hip_left_y": -1.6, "hip_left_z": 0.7, "ankle_right_x": 0.9})
    before, h = limits.nearest_angles(motion), 1e-6
    for axis in range(3):
        turned = motion[:, :3, :3] @ exp_so3(h * np.eye(3)[axis])
        numeric = (angles.angles(turned, before) - before) / h
        np.testing.assert_allclose(angles.rates(before)[:, axis], numeric, atol=1e-5)
