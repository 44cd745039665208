"""Smoothness of the body's motion: A eq. 10-11 with units, as deviation from constant velocity.

The paper penalises the change of pose between frames. That pulls every motion towards standing still; we penalise
the change of velocity instead, whose size in people is known: accelerations of limbs in m/s^2 and rad/s^2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import exp_se3, inverse, log_se3, nearest_rotation
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class MotionSettings:
    """How suddenly a segment may change its motion."""

    acceleration_sigma: float = setting(
        15.0,
        unit="m/s^2",
        limits=(0.1, 1000.0),
        reason="of a segment's origin; walking feet reach 30, heel strikes more",
    )
    angular_acceleration_sigma: float = setting(
        60.0, unit="rad/s^2", limits=(0.1, 5000.0), reason="of a segment; forearms and shins in quick motion reach 100"
    )
    velocity_time: float = setting(
        0.32,
        unit="s",
        limits=(0.01, 60.0),
        reason="a velocity that nothing sees fades in this time: a blind limb comes to rest instead of flying off",
    )


def predict(
    world_T_segment_before: NDArray[np.float64],
    world_T_segment: NDArray[np.float64],
    before_s: float,
    ahead_s: float,
    settings: MotionSettings,
) -> NDArray[np.float64]:
    """Poses (S, 4, 4) at the fading velocity of poses at two instants.

    Args:
        world_T_segment_before: (S, 4, 4) the earlier poses.
        world_T_segment: (S, 4, 4) the later poses.
        before_s: time between the two [s].
        ahead_s: time to predict [s].
        settings: how a velocity fades.
    """
    velocity = log_se3(inverse(world_T_segment_before) @ world_T_segment) / before_s
    return orthonormal(world_T_segment @ exp_se3(ahead_s * np.exp(-ahead_s / settings.velocity_time) * velocity))


def motion_sigmas(
    dt_s: float | NDArray[np.float64], previous_dt_s: float | NDArray[np.float64], settings: MotionSettings
) -> NDArray[np.float64]:
    """Sigmas (6), rotation [rad] then translation [m], of a segment's deviation from the prediction; (N, 6) of (N, 1).

    The mean velocity over ``dt_s`` differs from the one over ``previous_dt_s`` by the acceleration times half of both.
    """
    sigmas = [settings.angular_acceleration_sigma, settings.acceleration_sigma]
    return np.asarray(np.repeat(sigmas, 3) * dt_s * 0.5 * (dt_s + previous_dt_s))


def orthonormal(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses (S, 4, 4) with rotations put back onto SO(3): gtsam does not, and extrapolation amplifies the rounding."""
    mended = poses.copy()
    mended[:, :3, :3] = nearest_rotation(poses[:, :3, :3])
    return mended
