"""The articulated body's Jacobians, against numeric ones; forward kinematics against the body model's."""

import numpy as np
from helpers.range_of_motion import known_body, range_of_motion

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.geometry import inverse, log_se3


def some_motion() -> ArticulatedMotion:
    body = known_body()
    motion = range_of_motion(body, duration_s=3.0, rate_hz=2.0)
    twists = np.random.default_rng(5).normal(size=(len(motion.stamps_ns), len(body.mounts), 6))
    nothing = np.zeros(len(body.mounts))
    moved = body.motion_of(motion.world_T_segment)
    return ArticulatedMotion(body, tuple(body.mounts), moved, nothing, twists, nothing > 0.0)


def test_forward_kinematics_is_the_bodys() -> None:
    body = known_body()
    motion = range_of_motion(body, duration_s=3.0, rate_hz=2.0)
    np.testing.assert_allclose(some_motion().world_T_segment(), motion.world_T_segment, atol=1e-12)
    for c, camera in enumerate(body.mounts):
        np.testing.assert_allclose(some_motion().world_T_camera()[:, c], motion.world_T_camera[camera], atol=1e-12)


def test_jacobians_are_numeric_ones() -> None:
    motion = some_motion()
    J_moving, J_lasting = motion.moving_jacobians(), motion.lasting_jacobians()
    here = motion.world_T_camera()
    step = 1e-6
    no_moving, no_lasting = np.zeros((len(here), motion.moving_count)), np.zeros(motion.lasting_count)

    def slope(moving: np.ndarray, lasting: np.ndarray) -> np.ndarray:
        ahead = log_se3(inverse(here) @ motion.moved(moving, lasting).world_T_camera())
        behind = log_se3(inverse(here) @ motion.moved(-moving, -lasting).world_T_camera())
        return (ahead - behind) / (2 * step)

    for column in range(motion.moving_count):
        unit = no_moving.copy()
        unit[:, column] = step
        np.testing.assert_allclose(J_moving[..., column], slope(unit, no_lasting), atol=1e-7)
    for column in range(motion.lasting_count):
        unit = no_lasting.copy()
        unit[column] = step
        np.testing.assert_allclose(J_lasting[..., column], slope(no_moving, unit), atol=1e-7)
