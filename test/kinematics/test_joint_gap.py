import numpy as np
import pytest
from closed_joint import closed_pose

from bodycam_ros.geometry import exp_se3
from bodycam_ros.kinematics.joint import Joint, JointType
from bodycam_ros.kinematics.tangent import gap_jacobians, joint_gap


def any_joint(kind: JointType, random: np.random.Generator) -> Joint:
    on_parent, on_child = exp_se3(random.normal(size=(2, 6)))
    return Joint("any", "parent", "child", kind, on_parent, on_child, axis=random.normal(size=3))


@pytest.mark.parametrize("kind", ["ball", "hinge", "weld"])
def test_a_gap_is_zero_for_what_the_type_permits_and_only_then(kind: JointType) -> None:
    random = np.random.default_rng(2)
    joint = any_joint(kind, random)
    world_T_parent = exp_se3(random.normal(size=6))
    closed = world_T_parent @ closed_pose(joint, exp_se3(random.normal(size=6)))
    np.testing.assert_allclose(joint_gap(joint, world_T_parent, closed), 0.0, atol=1e-12)
    shifted = closed.copy()
    shifted[:3, 3] += [0.0, 0.03, 0.04]
    gap = joint_gap(joint, world_T_parent, shifted)
    assert np.linalg.norm(gap[3:]) == pytest.approx(0.05)
    np.testing.assert_allclose(gap[:3], 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", ["ball", "hinge", "weld"])
def test_gap_jacobians_are_the_numeric_ones_far_from_closed_too(kind: JointType) -> None:
    random = np.random.default_rng(4)
    for _ in range(5):
        joint = any_joint(kind, random)
        parent, child = exp_se3(0.7 * random.normal(size=(2, 6)))
        _, by_parent, by_child = gap_jacobians(joint, parent, child)
        h = 1e-6
        for column in range(6):
            xi = np.zeros(6)
            xi[column] = h
            numeric = joint_gap(joint, parent @ exp_se3(xi), child) - joint_gap(joint, parent @ exp_se3(-xi), child)
            np.testing.assert_allclose(by_parent[:, column], numeric / (2 * h), atol=1e-7)
            numeric = joint_gap(joint, parent, child @ exp_se3(xi)) - joint_gap(joint, parent, child @ exp_se3(-xi))
            np.testing.assert_allclose(by_child[:, column], numeric / (2 * h), atol=1e-7)
