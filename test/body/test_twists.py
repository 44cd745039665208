"""Kinematic chains as in Rosenhahn et al. 2008 (B), sections 2.1 and 2.2, equation by equation, against ours."""

import numpy as np
import pinocchio
import pytest
from known_motion import BODY
from numpy.typing import NDArray
from rider import rider_body
from scipy.linalg import expm

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.geometry import adjoint, exp_se3, exp_so3, hat

Array = NDArray[np.float64]


def twist_matrix(xi: Array) -> Array:
    """(4, 4) hat of a twist (6), rotation first (B eq. 2)."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = hat(xi[:3]), xi[3:]
    return matrix


def rodrigues(theta: float, xi: Array) -> Array:
    """exp(theta xi^) (4, 4) of a twist (6) whose rotation is of unit length, by the closed form that B 2.1 names."""
    omega, v = xi[:3], xi[3:]
    W = hat(omega)
    R = np.eye(3) + np.sin(theta) * W + (1.0 - np.cos(theta)) * W @ W
    matrix = np.eye(4)
    matrix[:3, :3] = R
    matrix[:3, 3] = (np.eye(3) - R) @ np.cross(omega, v) + omega * (omega @ v) * theta
    return matrix


def axis_twist(axis: Array, point: Array) -> Array:
    """The twist (6) of a turn about an axis through a point: a screw without pitch (B 2.1)."""
    return np.concatenate([axis, -np.cross(axis, point)])


def series(matrix: Array, terms: int = 40) -> Array:
    """The sum over k of matrix^k / k! (B 2.1)."""
    term = total = np.eye(4)
    for k in range(1, terms):
        term = term @ matrix / k
        total = total + term
    return total


def twists_of_the_joints(body: BodyModel, resting: Array) -> dict[str, list[tuple[Array, str]]]:
    """Segment -> twists in the world at rest of the joints that move it, with their angles' names: J(x) of B eq. 7.

    A ball is three turns about axes through one point, a hinge is one, a weld is none.
    """
    of_segment: dict[str, list[tuple[Array, str]]] = {body.root: []}
    for joint in body.tree_joints:
        world_T_joint = resting[body.segment_index[joint.parent]] @ joint.parent_T_joint
        of_ball = [np.eye(3)["xyz".index(axis)] for axis in joint.angle_axes]
        axes = {"ball": of_ball, "hinge": [joint.axis], "weld": []}[joint.type]
        turns = [axis_twist(world_T_joint[:3, :3] @ axis, world_T_joint[:3, 3]) for axis in axes]
        chain = list(zip(turns, joint.angle_names, strict=True))
        of_segment[joint.child] = [*of_segment[joint.parent], *chain]
    return of_segment


def product_of_exponentials(body: BodyModel, xi: Array, angles: dict[str, float]) -> Array:
    """Poses (S, 4, 4) of the pose configuration chi = (xi, Theta) of B eq. 4, as B eq. 3 moves every point."""
    resting = body.forward_kinematics(np.eye(4), np.tile(np.eye(3), (len(body.tree_joints), 1, 1)))
    chains = twists_of_the_joints(body, resting)
    poses = resting.copy()
    for row, segment in enumerate(body.segments):
        moved = series(twist_matrix(xi))
        for joint_twist, name in chains[segment]:
            moved = moved @ rodrigues(angles[name], joint_twist)
        poses[row] = moved @ resting[row]
    return poses


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(12)


def test_a_rigid_motion_is_a_matrix_that_moves_points(random: np.random.Generator) -> None:
    # B eq. 1: X' = M X in homogeneous coordinates is x' = R x + t.
    M = exp_se3(random.normal(size=6))
    x = random.normal(size=3)
    np.testing.assert_allclose((M @ [*x, 1.0])[:3], M[:3, :3] @ x + M[:3, 3], atol=1e-15)
    np.testing.assert_allclose(M[:3, :3] @ M[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(M[:3, :3]) > 0.0


def test_a_hat_is_antisymmetric_and_makes_cross_products(random: np.random.Generator) -> None:
    # B eq. 2.
    omega, x = random.normal(size=(2, 3))
    w1, w2, w3 = omega
    np.testing.assert_array_equal(hat(omega), [[0, -w3, w2], [w3, 0, -w1], [-w2, w1, 0]])
    np.testing.assert_allclose(hat(omega) @ x, np.cross(omega, x), atol=1e-15)


def test_the_exponential_of_a_twist_is_its_series_and_the_formula_of_rodrigues(random: np.random.Generator) -> None:
    for _ in range(20):
        xi = random.normal(size=6)
        theta = float(np.linalg.norm(xi[:3]))
        ours = exp_se3(xi)
        np.testing.assert_allclose(ours, series(twist_matrix(xi)), atol=1e-12)
        np.testing.assert_allclose(ours, expm(twist_matrix(xi)), atol=1e-12)
        np.testing.assert_allclose(ours, rodrigues(theta, xi / theta), atol=1e-12)
        np.testing.assert_allclose(ours[:3, :3], exp_so3(xi[:3]), atol=1e-12)


def test_a_joint_turns_about_a_line_that_stays(random: np.random.Generator) -> None:
    # B 2.1: a screw without pitch, for every angle of the one-parametric subgroup.
    axis, point = random.normal(size=(2, 3))
    xi = axis_twist(axis / np.linalg.norm(axis), point)
    for theta in random.uniform(-6.0, 6.0, 5):
        for along in (0.0, 1.0, -2.5):
            on_line = np.array([*(point + along * axis), 1.0])
            np.testing.assert_allclose(exp_se3(theta * xi) @ on_line, on_line, atol=1e-12)
        np.testing.assert_allclose(exp_se3(theta * xi) @ exp_se3(xi), exp_se3((theta + 1.0) * xi), atol=1e-12)


def test_a_twist_goes_to_other_axes_by_the_adjoint(random: np.random.Generator) -> None:
    xi, placed = random.normal(size=6), exp_se3(random.normal(size=6))
    moved = placed @ exp_se3(xi) @ np.linalg.inv(placed)
    np.testing.assert_allclose(exp_se3(adjoint(placed) @ xi), moved, atol=1e-12)


@pytest.mark.parametrize("body", [BODY, rider_body()], ids=["of the sample", "with hinge, weld and loop"])
def test_products_of_exponentials_are_our_forward_kinematics_and_pinocchios(body: BodyModel) -> None:
    # B eq. 3 and 4, for every segment of a whole body.
    random = np.random.default_rng(3)
    names = JointAngles(body).names
    model = pinocchio.buildModelFromXML(urdf_text(body), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    for _ in range(10):
        xi, theta = random.normal(size=6), random.uniform(-3.0, 3.0, len(names))
        ours = body.forward_kinematics(exp_se3(xi), JointAngles(body).rotations(theta))
        of_paper = product_of_exponentials(body, xi, dict(zip(names, theta, strict=True)))
        np.testing.assert_allclose(of_paper, ours, rtol=0.0, atol=1e-9)
        q = pinocchio.neutral(model)
        q[:7] = pinocchio.SE3ToXYZQUAT(pinocchio.SE3(exp_se3(xi)))
        for name, angle in zip(names, theta, strict=True):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.framesForwardKinematics(model, data, q)
        theirs = np.stack([data.oMf[model.getFrameId(segment)].homogeneous for segment in body.segments])
        np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=1e-9)
