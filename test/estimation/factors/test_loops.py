"""Loops of a state: open, closed, and closed unless far apart; soft slides; expected joints."""

import gtsam
import numpy as np
import pytest
from helpers.numeric_factor import assert_linearised

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.factor import on_state
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M, ExpectedJoints, JointRotations, SoftSlides
from bodycam_ros.estimation.factors.loops import Loops
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree

HERE = np.eye(4)


def two_segments() -> TreeTangent:
    """Segments that coincide, with a ball and two welds between them."""
    axis = np.array([0.0, 0.0, 1.0])
    joints = [
        Joint(name, "parent", "child", kind, HERE, HERE, axis=axis)
        for name, kind in (("ball", "ball"), ("one", "weld"), ("other", "weld"))
    ]
    return TreeTangent(KinematicTree("two", "parent", ("parent", "child"), tuple(joints)), LOOSE_M)


def normal_matrix(closed: dict[str, float], attachments: tuple[str, ...]) -> np.ndarray:
    """(K, K) of two segments that coincide, from loops alone."""
    tangent = two_segments()
    at = Coordinates(tangent, np.tile(HERE, (2, 1, 1)), np.zeros(tangent.count))
    _, J = Loops(tangent.tree, attachments).closed(closed).linearise(at)
    return J.T @ J


@pytest.mark.parametrize("kernel", [4.0, np.inf])
def test_an_open_loop_without_a_gap_weighs_nothing(kernel: float) -> None:
    both = normal_matrix({}, ())
    assert np.isfinite(both).all() and both.any()
    np.testing.assert_allclose(normal_matrix({"one": kernel}, ("one", "other")), 0.5 * both)
    assert not normal_matrix({}, ("one", "other")).any()


def test_a_closed_loop_is_linearised_as_its_error_changes() -> None:
    tangent = two_segments()
    at = Coordinates(tangent, np.tile(HERE, (2, 1, 1)), np.zeros(tangent.count))
    values = gtsam.Values()
    values.insert(0, np.random.default_rng(1).normal(scale=0.3, size=tangent.count))
    factor = on_state(0, Chart(at), [Loops(tangent.tree).closed({})], with_velocity=False)
    assert_linearised(factor, values, 2.0)  # sigmas of a tenth of a millimetre


def test_a_gap_costs_what_gtsams_cauchy_loss_has() -> None:
    tangent, shift = two_segments(), 0.001
    motion = np.stack([HERE, rigid(np.eye(3), np.array([shift, 0.0, 0.0]))])
    at = Coordinates(tangent, motion, np.zeros(tangent.count))
    loop = Loops(tangent.tree, ("one", "other")).closed({"one": 4.0})
    plain = Loops(tangent.tree, ("one", "other")).closed({"one": np.inf})
    distance = float(np.linalg.norm(plain.error(at)))
    assert distance > 4.0
    expected = gtsam.noiseModel.mEstimator.Cauchy.Create(4.0).loss(distance)
    assert 0.5 * float((loop.error(at) ** 2).sum()) == pytest.approx(expected)


def test_slides_and_expected_joints_are_linearised_as_their_errors_change() -> None:
    sigmas = (10.0, 10.0, 10.0, 0.02, 1e-4, 1e-4)
    slide = Joint("slide", "parent", "child", "ball", HERE, HERE, sigmas=sigmas)
    tangent = TreeTangent(KinematicTree("one", "parent", ("parent", "child"), (slide,)), SLIDES_M)
    at = Coordinates(tangent, np.tile(HERE, (2, 1, 1)), np.zeros(tangent.count))
    rotations = JointRotations(np.array([0]), exp_so3(np.array([[0.2, -0.5, 0.1]])), np.array([[0.1, 0.2, 0.3]]))
    soft, expected = SoftSlides(tangent), ExpectedJoints(tangent, rotations)
    assert (soft.rows, expected.rows) == (1, 3)
    values = gtsam.Values()
    values.insert(0, np.append(np.zeros(6), [0.3, 0.1, -0.2, 0.0]))
    assert_linearised(on_state(0, Chart(at), [expected], with_velocity=False), values, 1e-4)
    values.update(0, np.append(np.zeros(9), 0.05))
    error, J = soft.linearise(at.moved(np.append(np.zeros(9), 0.05)))
    np.testing.assert_allclose(error, [0.05 / 0.02])
    np.testing.assert_allclose(J[0, 9], 1.0 / 0.02)
