import numpy as np
import pytest
from helpers.closed_joint import closed_pose

from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.kinematics.joint import Joint, JointType
from bodycam_ros.kinematics.tangent import LoopGaps
from bodycam_ros.kinematics.tree import KinematicTree


def any_joint(kind: JointType, random: np.random.Generator) -> Joint:
    on_parent, on_child = exp_se3(random.normal(size=(2, 6)))
    return Joint("any", "parent", "child", kind, on_parent, on_child, axis=random.normal(size=3))


def joint_gaps(joints: list[Joint], world_T_parent: Array, world_T_child: Array) -> tuple[Array, Array, Array]:
    """Gaps (L, 6) between the same two segments, and how they change with both."""
    tree = KinematicTree("two", "parent", ("parent", "child"), (joints[0],))
    return LoopGaps(tree, joints).jacobians(np.stack([world_T_parent, world_T_child]))


@pytest.mark.parametrize("kind", ["ball", "hinge", "weld"])
def test_a_gap_is_zero_for_what_the_type_permits_and_only_then(kind: JointType) -> None:
    random = np.random.default_rng(2)
    joint = any_joint(kind, random)
    world_T_parent = exp_se3(random.normal(size=6))
    closed = world_T_parent @ closed_pose(joint, exp_se3(random.normal(size=6)))
    np.testing.assert_allclose(joint_gaps([joint], world_T_parent, closed)[0], 0.0, atol=1e-12)
    shifted = closed.copy()
    shifted[:3, 3] += [0.0, 0.03, 0.04]
    (gap,) = joint_gaps([joint], world_T_parent, shifted)[0]
    assert np.linalg.norm(gap[3:]) == pytest.approx(0.05)
    np.testing.assert_allclose(gap[:3], 0.0, atol=1e-12)


def test_gap_jacobians_are_the_numeric_ones_far_from_closed_too() -> None:
    random = np.random.default_rng(4)
    kinds: tuple[JointType, ...] = ("ball", "hinge", "weld", "hinge", "free")
    joints, h = [any_joint(kind, random) for kind in kinds], 1e-6
    for _ in range(5):
        parent, child = exp_se3(0.7 * random.normal(size=(2, 6)))
        _, by_parent, by_child = joint_gaps(joints, parent, child)
        for column, xi in enumerate(h * np.eye(6)):
            both = (joint_gaps(joints, parent @ exp_se3(step), child)[0] for step in (xi, -xi))
            np.testing.assert_allclose(by_parent[..., column], np.subtract(*both) / (2 * h), atol=1e-7)
            both = (joint_gaps(joints, parent, child @ exp_se3(step))[0] for step in (xi, -xi))
            np.testing.assert_allclose(by_child[..., column], np.subtract(*both) / (2 * h), atol=1e-7)
