"""Poses of segments by cameras, as normal equations and as a factor, against numeric derivatives."""

import gtsam
import numpy as np
import pytest
from helpers.moving_body import COVARIANCE, body_with_cameras, true_poses
from helpers.numeric_factor import assert_linearised

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors import camera_poses
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.factor import on_state
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.tangent import TreeTangent

BODY = body_with_cameras()
TANGENT = TreeTangent(BODY, SLIDES_M)
POSES = true_poses(BODY, 7)
AT = Coordinates(TANGENT, BODY.motion_of(POSES), np.zeros(TANGENT.count))
ROWS = np.array([0, 0, 1, 2], np.int64)


def residuals(at: Coordinates, measured: Array) -> Array:
    return log_se3(inverse(at.poses[ROWS]) @ measured)


def cameras(scatter: float) -> SegmentPoses:
    rng = np.random.default_rng(5)
    measured = AT.poses[ROWS] @ exp_se3(rng.normal(scale=scatter, size=(len(ROWS), 6)))
    return SegmentPoses(ROWS, measured, np.array([COVARIANCE * scale for scale in (1.0, 4.0, 9.0, 1e4)]))


def test_equations_are_those_of_numeric_derivatives() -> None:
    measured = cameras(0.05)
    A, b, r, J = measured.equations(AT)
    np.testing.assert_allclose(r, residuals(AT, measured.world_T_segment), atol=1e-12)
    for k, step in enumerate(1e-6 * np.eye(TANGENT.count)):
        ends = (residuals(AT.moved(sign * step), measured.world_T_segment) for sign in (-1.0, 1.0))
        earlier, later = ends
        np.testing.assert_allclose(J[:, :, k], (earlier - later) / 2e-6, atol=1e-6)
    W = measured.information
    np.testing.assert_allclose(A, np.einsum("nik,nij,njl->kl", J, W, J), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(b, np.einsum("nik,nij,nj->k", J, W, r), rtol=1e-9, atol=1e-6)


def test_rows_are_the_equations_by_their_weights() -> None:
    """Black and Rangarajan 1996: the gradient of Cauchy's loss."""
    measured = cameras(0.05)
    errors, J = measured.linearise(AT)
    r = residuals(AT, measured.world_T_segment)
    squared = np.einsum("ni,nij,nj->n", r, measured.information, r)
    assert (squared > camera_poses.KERNEL**2).any() and (squared < camera_poses.KERNEL**2).any()
    _, _, _, by_step = measured.equations(AT)
    W = measured.information / (1.0 + squared / camera_poses.KERNEL**2)[:, None, None]
    np.testing.assert_allclose(J.T @ J, np.einsum("nik,nij,njl->kl", by_step, W, by_step), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(-J.T @ errors, np.einsum("nik,nij,nj->k", by_step, W, r), rtol=1e-9, atol=1e-6)


def test_the_loss_is_that_of_gtsam() -> None:
    measured = cameras(0.05)
    cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(camera_poses.KERNEL)
    r = residuals(AT, measured.world_T_segment)
    distances = np.sqrt(np.einsum("ni,nij,nj->n", r, measured.information, r))
    expected = [cauchy.loss(float(distance)) for distance in distances]
    errors = measured.error(AT).reshape(-1, 6)
    np.testing.assert_allclose(0.5 * (errors**2).sum(axis=1), expected, rtol=1e-9)


@pytest.mark.parametrize("with_velocity", [False, True])
def test_the_factor_is_linearised_as_its_error_changes(monkeypatch: pytest.MonkeyPatch, with_velocity: bool) -> None:
    """Where all weights are one; away from the chart's origin."""
    monkeypatch.setattr(camera_poses, "KERNEL", np.inf)
    factor, values = on_state(0, Chart(AT), [cameras(0.01)], with_velocity), gtsam.Values()
    values.insert(0, np.random.default_rng(8).normal(scale=0.3, size=(1 + with_velocity) * TANGENT.count))
    assert_linearised(factor, values, 2e-2)


def test_no_cameras_measure_nothing() -> None:
    nothing = SegmentPoses.from_evidence(BODY, [])
    A, b, r, J = nothing.equations(AT)
    assert not A.any() and not b.any() and r.shape == (0, 6) and J.shape == (0, 6, TANGENT.count)
    assert nothing.rows == 0 and nothing.error(AT).shape == (0,)
