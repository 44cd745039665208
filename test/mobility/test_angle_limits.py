from dataclasses import replace

import numpy as np
from known_motion import BODY

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.mobility.angle_limits import AngleLimits


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


def test_angles_beyond_their_limits_are_named_with_how_far() -> None:
    body = with_a_hinge()
    limits = AngleLimits(body)
    assert not limits.beyond(motion_of(body, {}))
    found = limits.beyond(motion_of(body, {"knee_left": 2.0, "knee_right_y": 1.0, "hip_left_y": -1.5}))
    hip = next(joint for joint in body.joints if joint.name == "hip_left")
    assert hip.limits is not None
    assert found.keys() == {"knee_left", "hip_left_y"}
    np.testing.assert_allclose(found["knee_left"], (2.0, 0.3), atol=1e-9)
    np.testing.assert_allclose(found["hip_left_y"], (-1.5, -1.5 - hip.limits[0][0]), atol=1e-9)


def test_the_excess_changes_with_a_turn_as_it_is_said_to() -> None:
    body = with_a_hinge()
    limits = AngleLimits(body)
    motion = motion_of(body, {"knee_left": -0.5, "hip_left_y": -1.6, "hip_left_z": 0.7, "ankle_right_x": 0.9})
    h = 1e-6
    rows = []
    for row, excess, by_turn in limits.excess(motion):
        rows.append(body.tree_joints[row].name)
        for axis in range(3):
            turned = motion.copy()
            turned[row, :3, :3] = turned[row, :3, :3] @ exp_so3(h * np.eye(3)[axis])
            (after,) = (values for other, values, _ in limits.excess(turned) if other == row)
            np.testing.assert_allclose(by_turn[:, axis], (after - excess) / h, atol=1e-5)
    assert set(rows) == {"knee_left", "hip_left", "ankle_right"}
