"""Jacobians against differences, and against Pinocchio's."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.geometry import Array, adjoint, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.kinematics.tangent import LoopGaps, TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree, all_motion

H = 1e-6


@pytest.fixture
def coordinates(body: BodyModel, random: np.random.Generator) -> tuple[Array, Array]:
    angles = random.uniform(-1.0, 1.0, (3, len(JointAngles(body).names)))
    return exp_se3(random.normal(size=(3, 6))), JointAngles(body).poses(angles)


def poses_after(tangent: TreeTangent, coordinates: tuple[Array, Array], column: int, step: float) -> Array:
    increment = np.zeros((3, tangent.count))
    increment[:, column] = step
    return tangent.tree.poses_of(tangent.moved(all_motion(*coordinates), increment))


def test_jacobians_are_the_numeric_ones(body: BodyModel, coordinates: tuple[Array, Array]) -> None:
    tangent = TreeTangent(body)
    assert tangent.count == 6 + 2 * 3 + 3 * 1 + 6
    poses = body.forward_kinematics(*coordinates)
    J = tangent.segment_jacobians(poses)
    gaps = LoopGaps(body, body.loop_joints)
    J_gap = np.stack([gaps.linearised(*each)[1][0] for each in zip(poses, J, strict=True)])
    for column in range(tangent.count):
        before, after = (poses_after(tangent, coordinates, column, step) for step in (-H, H))
        numeric = log_se3(inverse(before) @ after) / (2.0 * H)
        np.testing.assert_allclose(J[..., column], numeric, atol=1e-8)
        numeric = np.stack(
            [gaps.jacobians(b)[0][0] - gaps.jacobians(a)[0][0] for a, b in zip(before, after, strict=True)]
        )
        np.testing.assert_allclose(J_gap[..., column], numeric / (2.0 * H), atol=1e-8)


def test_poses_and_jacobians_are_pinocchios(body: BodyModel, random: np.random.Generator) -> None:
    """The tree of the URDF that we export, whose balls are three hinges: its turns are ours, angle by angle."""
    names = JointAngles(body).names
    model = pin.buildModelFromXML(urdf_text(body), pin.JointModelFreeFlyer())
    data, angles = model.createData(), random.uniform(-1.0, 1.0, len(names))
    world_T_root = exp_se3(random.normal(size=6))
    q = pin.neutral(model)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(world_T_root))
    for name, angle in zip(names, angles, strict=True):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)

    tangent = TreeTangent(body)
    poses = body.forward_kinematics(world_T_root, JointAngles(body).poses(angles))
    J, rates = tangent.segment_jacobians(poses), JointAngles(body).rates(angles)
    for row, segment in enumerate(body.segments):
        frame = model.getFrameId(segment)
        np.testing.assert_allclose(poses[row], data.oMf[frame].homogeneous, atol=1e-10)
        # Theirs is linear first.
        theirs = pin.getFrameJacobian(model, data, frame, pin.LOCAL)[[3, 4, 5, 0, 1, 2]]
        np.testing.assert_allclose(J[row][:, :6], theirs[:, [3, 4, 5, 0, 1, 2]], atol=1e-10)
        for joint, xi, columns in zip(body.tree_joints, tangent.twists, tangent.columns, strict=True):
            of_angles = [name for name in joint.angle_names if "_at_" not in name]
            velocity = [model.joints[model.getJointId(name)].idx_v for name in of_angles]
            by_turn = rates[[names.index(name) for name in of_angles]] @ xi[:3]
            turns = xi[:3].any(axis=0)
            np.testing.assert_allclose(J[row][:, columns][:, turns], theirs[:, velocity] @ by_turn[:, turns], atol=1e-9)


def test_poses_are_the_papers_product_of_exponentials(body: BodyModel, random: np.random.Generator) -> None:
    """B eq. 3: all twists in the world, where the joints are in the N-pose; the last acts on the segment first."""
    theta = [random.normal(size=xi.shape[1]) for xi in TreeTangent(body).twists]
    motion = np.stack([exp_se3(xi @ part) for xi, part in zip(TreeTangent(body).twists, theta, strict=True)])
    world_T_root, at_zero = exp_se3(random.normal(size=6)), body.n_pose(np.eye(4))
    poses = body.forward_kinematics(world_T_root, motion)
    world_twists = adjoint(at_zero) @ TreeTangent(body).segment_jacobians(at_zero)
    for row in range(len(body.segments)):
        product = world_T_root
        for joint, columns in enumerate(TreeTangent(body).columns):
            if body.moves[row, joint]:
                product = product @ exp_se3(world_twists[row][:, columns] @ theta[joint])
        np.testing.assert_allclose(poses[row], product @ at_zero[row], atol=1e-12)


def test_coordinates_come_back_from_poses(body: BodyModel, coordinates: tuple[Array, Array]) -> None:
    poses = body.forward_kinematics(*coordinates)
    np.testing.assert_allclose(body.joint_poses(poses), coordinates[1], atol=1e-12)


def test_what_slides_moves_and_comes_back(body: BodyModel, coordinates: tuple[Array, Array]) -> None:
    tree = KinematicTree("t", body.root, body.segments, tuple(_sliding(joint) for joint in body.joints))
    tangent = TreeTangent(tree)
    increment = np.zeros((3, tangent.count))
    row = tree.joint_row["strap"]
    increment[:, tangent.columns[row]] = 0.2
    moved = tangent.moved(all_motion(*coordinates), increment)[:, 1:]
    np.testing.assert_allclose(moved[:, row, :3, 3], [[0.0, 0.2, 0.0]] * 3, atol=1e-12)
    slides = np.abs(np.stack([xi[3:].sum(axis=1) for xi in tangent.twists])) > 0.0
    poses = tree.forward_kinematics(coordinates[0], moved)
    np.testing.assert_allclose(tree.joint_poses(poses, slides), moved, atol=1e-12)


def _sliding(joint: Joint) -> Joint:
    return replace(joint, sigmas=(1e-4,) * 4 + (100.0, 1e-4)) if joint.type == "weld" else joint
