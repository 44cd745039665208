"""The motion prior: a white-noise acceleration on velocities that fade."""

import gtsam
import numpy as np
from helpers.moving_body import body_with_cameras, true_poses
from helpers.numeric_factor import numeric_jacobian

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.factors.motion import FADE_S, LASTS_S, MotionModel
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.kinematics.tangent import TreeTangent

BODY, DT_S = body_with_cameras(), 0.05
TANGENT = TreeTangent(BODY, SLIDES_M)
MODEL = MotionModel(TANGENT, MotionSettings())
K = TANGENT.count


def at(frame: int, velocity: np.ndarray | None = None) -> Coordinates:
    return Coordinates(TANGENT, BODY.motion_of(true_poses(BODY, frame)), np.zeros(K) if velocity is None else velocity)


def test_a_body_that_goes_on_as_it_did_has_no_error() -> None:
    before = at(4, np.random.default_rng(0).normal(size=K))
    motion = MODEL.between(before, DT_S)
    after = motion.predict(before)
    np.testing.assert_allclose(motion.error(before, after), 0.0, atol=1e-9)
    np.testing.assert_allclose(after.velocity, np.exp(-DT_S / FADE_S) * before.velocity)


def test_errors_have_the_covariance_of_accelerations_of_segments() -> None:
    before = at(4)
    motion = MODEL.between(before, DT_S)
    _, by_after = motion.jacobians
    covariance = np.linalg.inv(by_after.T @ by_after)
    sigmas = np.repeat([60.0, 15.0], 3) * np.sqrt(LASTS_S)
    information = sum(J.T @ np.diag(sigmas**-2.0) @ J for J in before.jacobians)
    density = np.linalg.inv(information)
    expected = np.block([[DT_S * density, DT_S**2 / 2 * density], [DT_S**2 / 2 * density, DT_S**3 / 3 * density]])
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-12)


def test_jacobians_are_numeric_ones_of_a_body_at_rest() -> None:
    before, after = at(4), at(4)
    motion = MODEL.between(before, DT_S)
    charts = Chart(before), Chart(after)
    for number, jacobian in enumerate(motion.jacobians):

        def error(x: np.ndarray, number: int = number) -> np.ndarray:
            ends = [before, after]
            ends[number] = charts[number].at(x)
            return motion.error(*ends)

        np.testing.assert_allclose(jacobian, numeric_jacobian(error, 2 * K), rtol=1e-5, atol=1e-3)


def test_the_factor_is_linear_about_both_origins() -> None:
    before, after = at(4, np.full(K, 0.5)), at(5, np.full(K, 0.3))
    motion, values = MODEL.between(before, DT_S), gtsam.Values()
    rng = np.random.default_rng(1)
    vectors = rng.normal(scale=0.01, size=(2, 2 * K))
    for key in (0, 1):
        values.insert(key, vectors[key])
    factor = motion.factor((0, 1), (Chart(before), Chart(after)))
    by_before, by_after = motion.jacobians
    expected = motion.error(before, after) + by_before @ vectors[0] + by_after @ vectors[1]
    assert abs(factor.error(values) / (0.5 * expected @ expected) - 1.0) < 1e-9


def test_coordinates_that_begin_anew_have_no_past() -> None:
    columns = np.zeros(K, bool)
    columns[TANGENT.columns[BODY.joint_row["elbow"]]] = True
    motion = MODEL.between(at(4), DT_S).restarted(columns)
    both = np.concatenate([columns, columns])
    for jacobian in motion.jacobians:
        assert len(jacobian) == 2 * K - 2
        assert not jacobian[:, both].any()


def test_loosened_coordinates_cost_nothing_within_the_range_of_a_joint() -> None:
    columns = np.zeros(K, bool)
    columns[TANGENT.columns[BODY.joint_row["elbow"]]] = True
    motion = MODEL.between(at(4), DT_S)
    turned = np.where(columns, 0.3, 0.0)
    stiff, loose = (each.error(at(4), at(4).moved(turned)) for each in (motion, motion.loosened(columns)))
    assert np.linalg.norm(stiff) > 5.0 and np.linalg.norm(loose) < 1.0
