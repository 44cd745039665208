"""The kernel of the cameras' normal equations, against residuals that are differentiated numerically."""

import numpy as np
import pytest
from moving_body import COVARIANCE, body_with_cameras, true_poses

from bodycam_ros.estimation.estimate import Coordinates
from bodycam_ros.estimation.measurements import SLIDES_M, SegmentPoses
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import all_motion

BODY = body_with_cameras()
TANGENT = TreeTangent(BODY, SLIDES_M)
POSES = true_poses(BODY, 7)
AT = Coordinates(TANGENT, all_motion(POSES[0], BODY.joint_poses(POSES)), np.zeros(TANGENT.count))
ROWS = np.array([0, 0, 1, 2], np.int64)


def residuals(at: Coordinates, measured: Array) -> Array:
    return log_se3(inverse(at.poses[ROWS]) @ measured)


@pytest.mark.parametrize("sigmas", [np.inf, 3.0])
def test_equations_are_those_of_numeric_derivatives(sigmas: float) -> None:
    rng = np.random.default_rng(5)
    measured = AT.poses[ROWS] @ exp_se3(rng.normal(scale=0.05, size=(len(ROWS), 6)))
    cameras = SegmentPoses(ROWS, measured, np.array([COVARIANCE * scale for scale in (1.0, 4.0, 9.0, 1e4)]))
    A, b, r, J = cameras.equations(AT, sigmas)
    information = cameras.information
    np.testing.assert_allclose(r, residuals(AT, measured), atol=1e-12)
    for k, step in enumerate(1e-6 * np.eye(TANGENT.count)):
        changed = (residuals(AT.moved(-step), measured) - residuals(AT.moved(step), measured)) / 2e-6
        np.testing.assert_allclose(J[:, :, k], changed, atol=1e-6)
    squared = np.einsum("ni,nij,nj->n", r, information, r)
    weighted = information / (1.0 + squared / sigmas**2)[:, None, None]
    np.testing.assert_allclose(A, np.einsum("nik,nij,njl->kl", J, weighted, J), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(b, np.einsum("nik,nij,nj->k", J, weighted, r), rtol=1e-9, atol=1e-6)


def test_no_cameras_measure_nothing() -> None:
    nothing = SegmentPoses.from_evidence(BODY, [])
    A, b, r, J = nothing.equations(AT)
    assert not A.any() and not b.any() and r.shape == (0, 6) and J.shape == (0, 6, TANGENT.count)
