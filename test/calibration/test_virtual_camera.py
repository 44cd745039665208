"""A eq. 6-7: several cameras on one segment as one."""

import numpy as np

from bodycam_ros.calibration.virtual_camera import fuse_cameras
from bodycam_ros.geometry import exp_se3, inverse, log_se3, rigid

NAMES = ("front", "left", "right")
PLACES = exp_se3(np.array([[0.0] * 6, [0.1, 1.5, -0.2, 0.1, 0.2, -0.3], [0.2, -1.4, 0.3, -0.2, 0.1, 0.1]]))
SEGMENT = exp_se3(np.sin(np.arange(90)[:, None] * np.array([0.05, 0.07, 0.03, 0.02, 0.04, 0.06])))
CAMERAS = SEGMENT[:, None] @ PLACES


def test_exact() -> None:
    virtual = fuse_cameras(NAMES, CAMERAS, np.ones((90, 3), bool))
    for k, name in enumerate(NAMES):
        np.testing.assert_allclose(virtual.virtual_T_camera[name], PLACES[k], atol=1e-9)
    np.testing.assert_allclose(virtual.world_T_virtual, SEGMENT, atol=1e-9)
    assert virtual.known.all()


def test_noise_averages_and_wrong_poses_move_no_mount() -> None:
    random = np.random.default_rng(2)
    sigmas = np.repeat([0.001, 0.005], 3)
    noisy = CAMERAS @ exp_se3(sigmas * random.normal(size=(90, 3, 6)))
    noisy[::9, 1] = rigid(np.eye(3), np.array([5.0, 5.0, 5.0]))
    virtual = fuse_cameras(NAMES, noisy, np.ones((90, 3), bool))
    mounts = np.stack([virtual.virtual_T_camera[name] for name in NAMES])
    assert np.abs(log_se3(inverse(PLACES) @ mounts)[:, 3:]).max() < 0.005
    errors, alone = (log_se3(inverse(SEGMENT) @ poses) for poses in (virtual.world_T_virtual, noisy[:, 0]))
    right = np.arange(90) % 9 > 0
    assert np.linalg.norm(errors[right, 3:], axis=1).mean() < np.linalg.norm(alone[right, 3:], axis=1).mean()
