"""Geometry against gtsam and SciPy."""

import gtsam
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from bodycam_ros import geometry
from bodycam_ros.geometry_kernels import log_se3_jacobian

TANGENTS = [
    np.zeros(6),
    np.array([1e-9, -2e-9, 1e-9, 0.3, 0.2, -0.1]),
    np.array([3e-5, 6e-5, -7e-5, 0.3, 0.2, -0.1]),  # angle just below and above the switch to the series
    np.array([4e-5, 7e-5, -7e-5, 0.3, 0.2, -0.1]),
    np.array([0.4, -0.7, 0.2, 1.0, -2.0, 3.0]),
    np.array([0.0, 0.0, np.pi - 1e-6, 1.0, -2.0, 3.0]),
]


@pytest.fixture
def poses() -> np.ndarray:
    rng = np.random.default_rng(1)
    return geometry.rigid(Rotation.random(20, random_state=2).as_matrix(), rng.normal(size=(20, 3)))


@pytest.mark.parametrize("xi", TANGENTS)
def test_exponential_and_logarithm_are_gtsams(xi: np.ndarray) -> None:
    T = geometry.exp_se3(xi)
    np.testing.assert_allclose(T, gtsam.Pose3.Expmap(xi).matrix(), atol=1e-9)
    np.testing.assert_allclose(T, expm(_wedge(xi)), atol=1e-12)
    np.testing.assert_allclose(geometry.log_se3(T), xi, atol=1e-8)
    np.testing.assert_allclose(geometry.exp_so3(xi[:3]), T[:3, :3], atol=0)
    np.testing.assert_allclose(geometry.log_so3(T[:3, :3]), xi[:3], atol=1e-8)


def test_rotation_vectors_are_scipys_at_all_angles() -> None:
    axes = np.random.default_rng(8).normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    near_half_turn = np.pi - np.geomspace(1e-7, 1.0, 200)
    w = axes * np.concatenate([np.geomspace(1e-12, 2.0, 200), near_half_turn])[:, None]
    R = geometry.exp_so3(w)
    np.testing.assert_allclose(R, Rotation.from_rotvec(w).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(geometry.log_so3(R), w, atol=1e-12, rtol=1e-9)


@pytest.mark.parametrize("size", [3, 6])
def test_a_logarithm_changes_as_its_jacobian_says(size: int) -> None:
    se3 = size == 6
    exp, log = (geometry.exp_se3, geometry.log_se3) if se3 else (geometry.exp_so3, geometry.log_so3)
    jacobian = log_se3_jacobian if se3 else geometry.log_jacobian
    r = np.random.default_rng(0).normal(scale=0.4, size=(5, size))
    by_d = np.array([jacobian(each) for each in r])
    for axis in range(size):
        d = 1e-6 * np.eye(size)[axis]
        changed = (log(exp(-d) @ exp(r)) - log(exp(d) @ exp(r))) / 2e-6
        np.testing.assert_allclose(-by_d[..., axis], changed, atol=2e-3)
    # gtsam's own, of which ours is the series to the fourth order.
    if se3:
        for xi in 0.3 * r:
            expected = np.linalg.inv(gtsam.Pose3.ExpmapDerivative(-xi))
            np.testing.assert_allclose(jacobian(xi), expected, atol=1e-6)


def test_adjoint_is_gtsams(poses: np.ndarray) -> None:
    expected = [gtsam.Pose3(T).AdjointMap() for T in poses]
    np.testing.assert_allclose(geometry.adjoint(poses), expected, atol=1e-12)
    xi = TANGENTS[4]
    moved = geometry.exp_se3(geometry.adjoint(poses[0]) @ xi) @ poses[0]
    np.testing.assert_allclose(moved, poses[0] @ geometry.exp_se3(xi), atol=1e-12)


def test_inverse_and_points(poses: np.ndarray) -> None:
    np.testing.assert_allclose(poses @ geometry.inverse(poses), np.tile(np.eye(4), (20, 1, 1)), atol=1e-12)
    points = np.random.default_rng(3).normal(size=(7, 3))
    expected = [gtsam.Pose3(poses[0]).transformFrom(p) for p in points]
    np.testing.assert_allclose(geometry.transform_points(poses[0], points), expected, atol=1e-12)
    np.testing.assert_allclose(geometry.transform_points(poses, points)[0], expected, atol=1e-12)


def test_quaternions_are_scipys_with_positive_w(poses: np.ndarray) -> None:
    R = poses[:, :3, :3]
    q = geometry.quaternion_xyzw(R)
    assert np.all(q[:, 3] >= 0)
    np.testing.assert_allclose(Rotation.from_quat(q).as_matrix(), R, atol=1e-12)
    np.testing.assert_allclose(geometry.rotation_from_xyzw(-3.0 * q), R, atol=1e-12)
    np.testing.assert_allclose(geometry.rotation_from_xyzw(q), Rotation.from_quat(q).as_matrix(), atol=1e-15)
    with pytest.raises(ValueError):
        geometry.rotation_from_xyzw(np.zeros(4))


@pytest.mark.parametrize("with_scale", [True, False])
def test_umeyama_recovers_the_alignment(poses: np.ndarray, with_scale: bool) -> None:
    source = np.random.default_rng(4).normal(size=(30, 3))
    scale = 2.5 if with_scale else 1.0
    target = scale * geometry.transform_points(poses[0], source)
    found_scale, R, t = geometry.umeyama(source, target, with_scale)
    assert found_scale == pytest.approx(scale, abs=1e-12)
    np.testing.assert_allclose(R, poses[0, :3, :3], atol=1e-12)
    np.testing.assert_allclose(t, scale * poses[0, :3, 3], atol=1e-12)


def test_umeyama_is_the_least_squares_optimum_for_mirrored_and_flat_points() -> None:
    source = np.random.default_rng(5).normal(size=(30, 3))
    _, R, _ = geometry.umeyama(source, source * [1, 1, -1], with_scale=False)
    expected, _ = Rotation.align_vectors((source - source.mean(0)) * [1, 1, -1], source - source.mean(0))
    np.testing.assert_allclose(R, expected.as_matrix(), atol=1e-7)
    flat = source * [1, 1, 0]
    turn = Rotation.from_rotvec([0.3, 0.4, 0.5]).as_matrix()
    np.testing.assert_allclose(geometry.umeyama(flat, flat @ turn.T, with_scale=True)[1], turn, atol=1e-12)


def test_average_withstands_outliers(poses: np.ndarray) -> None:
    rng = np.random.default_rng(6)
    good = poses[0] @ geometry.exp_se3(rng.normal(scale=0.01, size=(140, 6)))
    outliers = geometry.rigid(Rotation.random(60, random_state=7).as_matrix(), rng.normal(scale=5.0, size=(60, 3)))
    error = geometry.log_se3(
        geometry.inverse(poses[0]) @ geometry.robust_average_pose(np.concatenate([good, outliers]))
    )
    assert np.linalg.norm(error[:3]) < 0.01
    assert np.linalg.norm(error[3:]) < 0.01


def _wedge(xi: np.ndarray) -> np.ndarray:
    M = np.zeros((4, 4))
    M[:3, :3] = geometry.hat(xi[:3])
    M[:3, 3] = xi[3:]
    return M
