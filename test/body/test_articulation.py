"""The articulated body's Jacobians, against numeric ones; forward kinematics against the body model's."""

import numpy as np
from range_of_motion import known_body, range_of_motion

from bodycam_ros.body.articulation import ArticulatedMotion, articulated
from bodycam_ros.geometry import inverse, log_se3


def some_motion() -> ArticulatedMotion:
    body = known_body()
    motion = range_of_motion(body, duration_s=3.0, rate_hz=2.0)
    root = body.segment_index[body.root]
    twists = np.random.default_rng(5).normal(size=(len(motion.stamps_ns), len(body.mounts), 6))
    return articulated(
        body,
        tuple(body.mounts),
        motion.world_T_segment[:, root, :3, 3],
        motion.world_T_segment[..., :3, :3],
        twists,
        np.zeros(len(body.mounts), bool),
    )


def test_forward_kinematics_is_the_bodys() -> None:
    body = known_body()
    motion = range_of_motion(body, duration_s=3.0, rate_hz=2.0)
    np.testing.assert_allclose(some_motion().world_T_segment(), motion.world_T_segment, atol=1e-12)
    for c, camera in enumerate(body.mounts):
        np.testing.assert_allclose(some_motion().world_T_camera()[:, c], motion.world_T_camera[camera], atol=1e-12)


def test_jacobians_are_numeric_ones() -> None:
    motion = some_motion()
    J_moving, J_lasting = motion.jacobians()
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
    root = motion.offset_columns(motion.body.segment_index[motion.body.root])
    for column in range(motion.lasting_count):
        if not root.start <= column < root.stop:
            unit = no_lasting.copy()
            unit[column] = step
            np.testing.assert_allclose(J_lasting[..., column], slope(no_moving, unit), atol=1e-7)
