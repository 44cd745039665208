"""Keypoints of joints as a factor and as normal equations, against numeric derivatives."""

import gtsam
import numpy as np
import pytest
from helpers.known_lenses import LENSES
from helpers.moving_body import body_with_cameras, true_poses
from helpers.numeric_factor import SMALL, assert_linearised

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.factors import joint_keypoints
from bodycam_ros.estimation.factors.factor import on_state
from bodycam_ros.estimation.factors.joint_keypoints import JointKeypoints
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.geometry import Array, exp_se3, inverse, transform_points
from bodycam_ros.kinematics.tangent import TreeTangent

BODY = body_with_cameras()
TANGENT = TreeTangent(BODY, SLIDES_M)
POSES = true_poses(BODY, 7)
AT = Coordinates(TANGENT, BODY.motion_of(POSES), np.zeros(TANGENT.count))
SEGMENTS = np.array([0, 1, 2, 2], np.int64)
CAMERAS = np.array([0, 1, 0, 1], np.int64)
SIGMAS = np.array([4.0, 5.0, 6.0, 8.0])
CENTRE = POSES[:, :3, 3].mean(axis=0)


def from_side(turn: float) -> Array:
    """A camera three metres from the body that looks at it, turned about its middle."""
    looking = exp_se3(np.array([0.0, turn, 0.0, 0.0, 0.0, 0.0]))
    looking[:3, 3] = CENTRE - 3.0 * looking[:3, 2]
    return looking


VIEWS = {"front": (LENSES["plumb_bob"], from_side(0.3)), "side": (LENSES["equidistant"], from_side(1.6))}


def projected(poses: Array) -> Array:
    rows = []
    for camera, segment in zip(CAMERAS, SEGMENTS, strict=True):
        lens, world_T_camera = [*VIEWS.values()][camera]
        rows.append(lens.project(transform_points(inverse(world_T_camera), poses[segment, None, :3, 3]))[0][0])
    return np.array(rows)


def keypoints(off_px: float) -> JointKeypoints:
    off = np.random.default_rng(3).normal(0.0, off_px, (len(SEGMENTS), 2))
    return JointKeypoints(VIEWS, CAMERAS, SEGMENTS, projected(POSES) + off, SIGMAS)


def test_keypoints_where_the_joints_project_have_no_error() -> None:
    np.testing.assert_allclose(keypoints(0.0).error(AT), 0.0, atol=1e-9)


@pytest.mark.parametrize("with_velocity", [False, True])
def test_the_factor_is_linearised_as_its_error_changes(monkeypatch: pytest.MonkeyPatch, with_velocity: bool) -> None:
    """Where all weights are one; away from the chart's origin."""
    monkeypatch.setattr(joint_keypoints, "KERNEL", np.inf)
    factor, values = on_state(0, Chart(AT), [keypoints(6.0)], with_velocity), gtsam.Values()
    values.insert(0, np.random.default_rng(8).normal(scale=0.1, size=(1 + with_velocity) * TANGENT.count))
    assert_linearised(factor, values, 1e-3)


def test_the_gradient_is_that_of_the_robust_loss() -> None:
    measured = keypoints(30.0)
    errors, J = measured.linearise(AT)
    assert (np.linalg.norm((projected(POSES) - measured.pixels) / SIGMAS[:, None], axis=1) > 4.0).any()

    def loss(at: Coordinates) -> float:
        return float(0.5 * (measured.error(at) ** 2).sum())

    for k, step in enumerate(SMALL * np.eye(TANGENT.count)):
        numeric = (loss(AT.moved(step)) - loss(AT.moved(-step))) / (2.0 * SMALL)
        assert (J.T @ errors)[k] == pytest.approx(numeric, rel=1e-4, abs=1e-3)


def test_equations_of_segments_are_those_of_the_factor() -> None:
    measured = keypoints(30.0)
    errors, J = measured.linearise(AT)
    A, b = measured.equations(AT.poses)
    tangents = AT.jacobians
    np.testing.assert_allclose(np.einsum("sik,sij,sjl->kl", tangents, A, tangents), J.T @ J, atol=1e-6)
    np.testing.assert_allclose(np.einsum("sik,si->k", tangents, b), -J.T @ errors, atol=1e-6)


def test_keypoints_of_later_images_are_where_the_joints_were_before() -> None:
    velocities = np.random.default_rng(4).normal(0.0, 1.0, (len(POSES), 6))
    late_s = np.full(len(SEGMENTS), 1e-3)
    later = JointKeypoints(VIEWS, CAMERAS, SEGMENTS, projected(POSES @ exp_se3(1e-3 * velocities)), SIGMAS)
    np.testing.assert_allclose(later.late(POSES, velocities, late_s).pixels, projected(POSES), atol=0.01)


def test_a_joint_behind_a_camera_is_an_error_without_a_derivative() -> None:
    behind = from_side(0.3) @ np.diag([-1.0, 1.0, -1.0, 1.0])
    views = VIEWS | {"front": (LENSES["plumb_bob"], behind)}
    errors, J = JointKeypoints(views, CAMERAS, SEGMENTS, projected(POSES), SIGMAS).linearise(AT)
    assert errors[:2].all() and not J[:2].any() and J[2:4].any()


def test_no_keypoints_measure_nothing() -> None:
    nothing = JointKeypoints.nothing()
    assert nothing.rows == 0 and nothing.error(AT).shape == (0,)
