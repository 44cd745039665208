"""Charts of states: vectors there and back, and how a vector moves a body, by differences."""

import numpy as np
from helpers.moving_body import body_with_cameras, true_poses
from helpers.numeric_factor import numeric_jacobian

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.geometry import exp_se3, inverse, log_se3
from bodycam_ros.geometry_kernels import exp_se3_jacobian
from bodycam_ros.kinematics.tangent import TreeTangent

BODY = body_with_cameras()
TANGENT = TreeTangent(BODY, SLIDES_M)
RNG = np.random.default_rng(4)


def coordinates(frame: int) -> Coordinates:
    return Coordinates(TANGENT, BODY.motion_of(true_poses(BODY, frame)), RNG.normal(size=TANGENT.count))


def test_a_vector_leads_to_coordinates_and_back() -> None:
    chart, at = Chart(coordinates(3)), coordinates(20)
    x = chart.vector(at)
    there = chart.at(x)
    np.testing.assert_allclose(there.poses, at.poses, atol=1e-12)
    np.testing.assert_allclose(there.velocity, at.velocity, atol=1e-12)
    alone = chart.at(x[TANGENT.count :])
    np.testing.assert_allclose(alone.poses, at.poses, atol=1e-12)
    np.testing.assert_array_equal(alone.velocity, chart.origin.velocity)


def test_increments_chain_to_vectors() -> None:
    chart, x = Chart(coordinates(3)), RNG.normal(scale=0.8, size=TANGENT.count)
    at = chart.at(x)

    def moved(change: np.ndarray) -> np.ndarray:
        return at.step_to(chart.at(x + change))

    numeric = numeric_jacobian(moved, TANGENT.count)
    np.testing.assert_allclose(chart.by_vector(np.eye(TANGENT.count), x), numeric, atol=1e-6)


def test_the_jacobian_of_the_exponential_is_numeric() -> None:
    for scale in (1e-9, 0.3, 1.2):
        xi = RNG.normal(scale=scale, size=6)

        def moved(change: np.ndarray, xi: np.ndarray = xi) -> np.ndarray:
            return log_se3(inverse(exp_se3(xi)) @ exp_se3(xi + change))

        np.testing.assert_allclose(exp_se3_jacobian(xi), numeric_jacobian(moved, 6), atol=1e-7)
