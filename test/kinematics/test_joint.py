import gtsam
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_so3, rigid
from bodycam_ros.kinematics.joint import Joint, JointType, hinge_angle

PARENT_T_JOINT = rigid(exp_so3(np.array([0.4, -0.3, 0.2])), np.array([0.02, 0.2, -0.38]))
CHILD_T_JOINT = rigid(exp_so3(np.array([-0.1, 0.7, 0.5])), np.array([0.12, -0.03, -0.08]))
AXIS = np.array([0.6, 0.0, 0.8])


def off_origin_joint(joint_type: JointType) -> Joint:
    return Joint("j", "a", "b", joint_type, PARENT_T_JOINT, CHILD_T_JOINT, AXIS)


def closed(joint: Joint, rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose of the child in the parent at a joint rotation."""
    return joint.parent_T_joint @ rigid(rotation, np.zeros(3)) @ inverse(joint.child_T_joint)


def permitted(joint_type: JointType) -> NDArray[np.float64]:
    return exp_so3({"ball": np.array([0.5, -1.0, 0.7]), "hinge": 1.9 * AXIS, "weld": np.zeros(3)}[joint_type])


@pytest.mark.parametrize("joint_type", ["ball", "hinge", "weld"])
def test_gtsam_holds_the_joint_against_noisy_priors(joint_type: JointType, random: np.random.Generator) -> None:
    joint = off_origin_joint(joint_type)
    world_T_parent = exp_se3(random.normal(size=6))
    sigmas = np.array([0.03] * 3 + [0.005] * 3)
    noise = [exp_se3(sigmas * random.normal(size=6)) for _ in range(2)]
    priors = [world_T_parent @ noise[0], world_T_parent @ closed(joint, permitted(joint_type)) @ noise[1]]
    parent, child = priors
    for _ in range(4):  # the measured pose is re-centred on the estimate
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for key, (prior, estimate) in enumerate(zip(priors, (parent, child), strict=True)):
            graph.add(gtsam.PriorFactorPose3(key, gtsam.Pose3(prior), gtsam.noiseModel.Diagonal.Sigmas(sigmas)))
            values.insert(key, gtsam.Pose3(estimate))
        measured = gtsam.Pose3(joint.measured_relative_pose(inverse(parent) @ child))
        information = gtsam.noiseModel.Gaussian.Information(joint.information)
        graph.add(gtsam.BetweenFactorPose3(0, 1, measured, information))
        result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
        parent, child = result.atPose3(0).matrix(), result.atPose3(1).matrix()
    between_joint_frames = inverse(parent @ PARENT_T_JOINT) @ child @ CHILD_T_JOINT
    assert np.linalg.norm(between_joint_frames[:3, 3]) < 10e-6
    rotation = log_so3(between_joint_frames[:3, :3])
    forbidden = {"ball": 0.0, "hinge": np.linalg.norm(np.cross(rotation, AXIS)), "weld": np.linalg.norm(rotation)}
    assert forbidden[joint_type] < 1e-4
    # What is free stays as the priors have it, up to what the closing gap turns.
    assert np.linalg.norm(log_so3(priors[1][:3, :3].T @ child[:3, :3])) < 0.2


def test_hinge_angle_is_the_twist_of_the_quaternion(random: np.random.Generator) -> None:
    rotations = Rotation.random(200, random_state=1)
    axes = random.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    q = rotations.as_quat()
    twist = 2.0 * np.arctan2(np.sum(q[:, :3] * axes, axis=1), q[:, 3])
    difference = hinge_angle(rotations.as_matrix(), axes) - twist
    np.testing.assert_allclose(np.cos(difference), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"type": "slider"}, "ball, hinge, weld"),
        ({"child": "a"}, ""),
        ({"axis": np.zeros(3)}, "axis"),
        ({"parent_T_joint": np.full((4, 4), np.inf)}, ""),
        ({"sigmas": (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)}, ""),
        ({"limits": ((0.0, 1.0),)}, ""),
    ],
)
def test_what_is_no_joint_is_refused_by_name(changes: dict[str, object], named: str) -> None:
    fields = {"name": "hip", "parent": "a", "child": "b", "type": "ball", "parent_T_joint": np.eye(4)} | changes
    with pytest.raises(BodyError, match=f"joint hip.*{named}"):
        Joint(**fields)  # type: ignore[arg-type]
