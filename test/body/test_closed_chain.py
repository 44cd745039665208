"""The pedal of B 3.1 (eq. 10-13, figure 3): our numeric chain against what the paper derives by hand."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.mechanism import Mechanism, project
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

J = np.array([0.0, 3.0])
P = np.array([0.0, 5.0])
C = np.array([0.0, 4.0])
RADIUS = 1.0


def at(x: float, y: float) -> Array:
    return rigid(np.eye(3), np.array([x, y, 0.0]))


def leg_on_a_pedal() -> BodyModel:
    """Hinges about z at the origin and at j; a crank of length 1, hinged at C, whose end is held at p."""
    z = np.array([0.0, 0.0, 1.0])
    return BodyModel(
        "pedal",
        "ground",
        ("ground", "thigh", "shin", "crank"),
        (
            Joint("theta_1", "ground", "thigh", "hinge", at(0.0, 0.0), axis=z),
            Joint("theta_2", "thigh", "shin", "hinge", at(*J), axis=z),
            Joint("crank", "ground", "crank", "hinge", at(*C), axis=z),
            Joint("pedal", "crank", "shin", "hinge", at(0.0, RADIUS), at(*(P - J)), axis=z),
        ),
        {},
    )


def of_the_paper(theta_1: float) -> tuple[float, Array]:
    """theta_2 and p' (B 3.1, the solution of eq. 12, and eq. 13), of the two solutions the one whose root is positive.

    Eq. 13 is right as printed. Three slips of print are read as eq. 10 demands: eq. 11 ends in + 3 cos(theta_1); the
    minus of the first term in the arctangent goes before its whole numerator, as in eq. 13; and the arctangent is of
    two numbers, sine and cosine of theta_1 + theta_2, of which only the first is in print.
    """
    s, c = np.sin(theta_1), np.cos(theta_1)
    root = np.sqrt(-6.0 + 15.0 * c - 9.0 * c**2)
    below = 24.0 * c - 25.0
    x = -(36.0 * s * c + 12.0 * root * c - 33.0 * s - 16.0 * root) / below
    y = -(-36.0 * c**2 - 15.0 * c + 12.0 * s * root + 56.0) / below
    sine = -(18.0 * s * c - 6.0 * root * c - 21.0 * s + 8.0 * root) / below
    cosine = (y - 3.0 * c) / 2.0
    return np.arctan2(sine, cosine) - theta_1, np.array([x, y])


def end_by_two_turns(theta_1: float, theta_2: float) -> Array:
    """Where the end effector is (B eq. 10)."""
    first, second = (exp_so3(np.array([0.0, 0.0, angle]))[:2, :2] for angle in (theta_1, theta_2))
    end: Array = first @ (second @ (P - J) + J)
    return end


def closed_at(mechanism: Mechanism, theta_1: float, near: tuple[float, float]) -> Array:
    """The chain with the first angle given, closed by the other two from a guess of them."""
    guess = np.zeros(mechanism.tangent.count)
    own = [mechanism.columns[name][0] for name in ("theta_1", "theta_2", "crank")]
    guess[own] = theta_1, *near
    others = np.array(own[1:])
    return project(mechanism, mechanism.tangent.moved(mechanism.resting(), guess), others)


@pytest.mark.parametrize("theta_1", np.concatenate([np.linspace(-0.84, -0.05, 12), np.linspace(0.05, 0.84, 12)]))
def test_the_chain_closed_by_numbers_is_the_one_that_the_paper_derives(theta_1: float) -> None:
    theta_2, end = of_the_paper(theta_1)
    np.testing.assert_allclose(end_by_two_turns(theta_1, theta_2), end, rtol=0.0, atol=1e-12)
    assert np.hypot(*(end - C)) == pytest.approx(RADIUS, abs=1e-12)  # B eq. 12
    mechanism = Mechanism(leg_on_a_pedal())
    turn_of_crank = np.arctan2(-(end - C)[0], (end - C)[1])
    closed = closed_at(mechanism, theta_1, (theta_2 + 0.05, turn_of_crank - 0.05))
    poses = mechanism.tree.poses_of(closed)
    ground, thigh, shin, crank = (
        poses[mechanism.body.segment_index[name]] for name in ("ground", "thigh", "shin", "crank")
    )
    np.testing.assert_array_equal(ground, np.eye(4))
    ours_2 = float(np.arctan2(*(thigh[:3, :3].T @ shin[:3, :3])[[1, 0], 0]))
    assert ours_2 == pytest.approx((theta_2 + np.pi) % (2.0 * np.pi) - np.pi, abs=1e-9)
    np.testing.assert_allclose((shin @ at(*(P - J)))[:2, 3], end, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose((crank @ at(0.0, RADIUS))[:2, 3], end, rtol=0.0, atol=1e-9)


def test_the_other_solution_is_found_from_its_side() -> None:
    theta_1 = 0.3
    _, end = of_the_paper(theta_1)
    elbow = 3.0 * np.array([-np.sin(theta_1), np.cos(theta_1)])
    along = (C - elbow) / np.linalg.norm(C - elbow)
    mirrored = elbow + 2.0 * along * (along @ (end - elbow)) - (end - elbow)
    mechanism = Mechanism(leg_on_a_pedal())
    theta_2 = np.arctan2(-(mirrored - elbow)[0], (mirrored - elbow)[1]) - theta_1
    crank = np.arctan2(-(mirrored - C)[0], (mirrored - C)[1])
    closed = closed_at(mechanism, theta_1, (theta_2 + 0.05, crank - 0.05))
    shin = mechanism.tree.poses_of(closed)[mechanism.body.segment_index["shin"]]
    np.testing.assert_allclose((shin @ at(*(P - J)))[:2, 3], mirrored, rtol=0.0, atol=1e-9)
