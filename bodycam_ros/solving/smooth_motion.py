"""Smoothness of a recorded motion, seen from both sides: A eq. 10-11 over three instants at a time.

The forward pass knows only what came before, so its motion is a step of fixed size from the instant before. Here all
three poses may move: the step to an instant is the step before it, times how much of a velocity is left by then.
"""

from dataclasses import dataclass
from typing import Self

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import hat, inverse, log_se3
from bodycam_ros.solving.motion import MotionSettings

Array = NDArray[np.float64]
Key = int


@dataclass(frozen=True)
class MotionLimits:
    """How suddenly each segment may change its motion.

    Attributes:
        accelerations: (S, 6) sigmas, rotation [rad/s^2] then translation [m/s^2]; (T, S, 6) where they change.
        velocity_time: (S,) in which a velocity that nothing sees fades [s].
    """

    accelerations: Array
    velocity_time: Array

    @classmethod
    def of(cls, settings: MotionSettings, segments: int) -> Self:
        """All segments alike."""
        sigmas = np.repeat([settings.angular_acceleration_sigma, settings.acceleration_sigma], 3)
        return cls(np.tile(sigmas, (segments, 1)), np.full(segments, settings.velocity_time))

    def of_steps(self, count: int) -> Array:
        """(T - 1, S, 6) accelerations of the steps between T instants."""
        return np.broadcast_to(self.accelerations, (count, *self.accelerations.shape[-2:]))[1:]


class SmoothMotion:
    """The deviations from a fading velocity of T instants, and their derivatives.

    Args:
        motion: of the segments (S).
        stamps_ns: (T,) of the instants.
    """

    def __init__(self, motion: MotionLimits, stamps_ns: NDArray[np.int64]) -> None:
        dt_s = 1e-9 * np.diff(stamps_ns).astype(np.float64)
        before_s = np.concatenate([dt_s[:1], dt_s[:-1]])
        left = np.exp(-dt_s[:, None] / motion.velocity_time)
        self._ratio = (left * (dt_s / before_s)[:, None])[:, :, None]
        # A mean velocity differs from the one before by the acceleration times half of both times.
        steps = motion.of_steps(len(stamps_ns))
        self._weight = 1.0 / (steps * (0.5 * dt_s * (dt_s + before_s))[:, None, None])
        if len(dt_s):
            # Nothing comes before the first step: it is one of the velocities that people have.
            self._ratio[0] = 0.0
            velocities = steps[0] * np.sqrt(0.5 * motion.velocity_time)[:, None]
            self._weight[0] = 1.0 / (velocities * np.sqrt(dt_s[0]) * dt_s[0])

    def error(self, world_T_segment: Array) -> float:
        """Half the sum of squared deviations, in sigmas, of poses (T, S, 4, 4)."""
        residual, _ = self._residual(world_T_segment)
        return 0.5 * float(np.square(residual * self._weight).sum())

    def linearised(self, world_T_segment: Array, first_key: Key) -> gtsam.GaussianFactorGraph:
        """One factor for each step of each segment, at poses (T, S, 4, 4); keys count segments, then instants."""
        graph = gtsam.GaussianFactorGraph()
        if len(world_T_segment) < 2:
            return graph
        residual, steps = self._residual(world_T_segment)
        weight = self._weight[..., None]
        from_start, from_end = _inverse_jacobians(steps)
        b = -(residual * self._weight)
        of_end, of_start = weight * from_end, -weight * from_start
        of_before = np.zeros_like(of_start)
        of_start[1:] -= weight[1:] * self._ratio[1:, ..., None] * from_end[:-1]
        of_before[1:] = weight[1:] * self._ratio[1:, ..., None] * from_start[:-1]
        unit = gtsam.noiseModel.Unit.Create(6)
        segments = residual.shape[1]
        keys = first_key + np.arange(residual.shape[0] * segments)
        flat = (of_before.reshape(-1, 6, 6), of_start.reshape(-1, 6, 6), of_end.reshape(-1, 6, 6), b.reshape(-1, 6))
        for key, A0, A1, A2, right in zip(keys.tolist(), *flat, strict=True):
            if key < first_key + segments:
                graph.push_back(gtsam.JacobianFactor(key, A1, key + segments, A2, right, unit))
            else:
                graph.push_back(gtsam.JacobianFactor(key - segments, A0, key, A1, key + segments, A2, right, unit))
        return graph

    def _residual(self, world_T_segment: Array) -> tuple[Array, Array]:
        """Deviations (T - 1, S, 6) of the steps (T - 1, S, 6) from those before them."""
        steps = log_se3(inverse(world_T_segment[:-1]) @ world_T_segment[1:])
        residual = steps.copy()
        residual[1:] -= self._ratio[1:] * steps[:-1]
        return residual, steps


def _inverse_jacobians(xi: Array) -> tuple[Array, Array]:
    """Left and right inverse Jacobians (..., 6, 6) of SE(3) at tangents (..., 6), to the fourth order of their size."""
    ad = np.zeros((*xi.shape[:-1], 6, 6))
    ad[..., :3, :3] = ad[..., 3:, 3:] = hat(xi[..., :3])
    ad[..., 3:, :3] = hat(xi[..., 3:])
    ad2 = ad @ ad
    even = np.eye(6) + ad2 / 12.0 - ad2 @ ad2 / 720.0
    return even - 0.5 * ad, even + 0.5 * ad
