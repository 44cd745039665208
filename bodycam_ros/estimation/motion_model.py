"""The motion prior: a white-noise acceleration of every coordinate, on velocities that fade (A eq. 10-11, altered).

The paper penalises the change of pose between frames. That pulls every motion towards standing still; we penalise the
change of velocity, whose size in people is known: accelerations of limbs in m/s^2 and rad/s^2.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.estimate import UNKNOWN, Coordinates, Estimate, MotionPrior, Transition
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, nearest_rotation, rigid
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.settings import setting

FADE_S = 0.2  # in which an unobserved velocity fades: a blind limb comes to rest instead of flying off
LASTS_S = 0.033  # how long an acceleration lasts: with it a standard deviation becomes a spectral density
_FIRST_SPEED = 4.0  # [rad/s], [m/s] sigma of people, before the motion is known


@dataclass(frozen=True)
class MotionSettings:
    """How suddenly a body changes its motion."""

    acceleration_sigma: float = setting(
        15.0,
        unit="m/s^2",
        limits=(0.1, 1000.0),
        reason="of a segment's origin; walking feet reach 30, heel strikes more",
    )
    angular_acceleration_sigma: float = setting(
        60.0, unit="rad/s^2", limits=(0.1, 5000.0), reason="of a segment; forearms and shins in quick motion reach 100"
    )


class MotionModel:
    """Predicts a body.

    Args:
        tangent: its coordinates.
        settings: how suddenly people change their motion.

    Attributes:
        tangent: as given.
        fade_s: (K) in which velocities of people fade [s].
    """

    def __init__(self, tangent: TreeTangent, settings: MotionSettings) -> None:
        self.tangent = tangent
        self.fade_s = np.full(tangent.count, FADE_S)
        self._first = np.append(np.full(tangent.count, UNKNOWN), np.full(tangent.count, _FIRST_SPEED))
        equipment = tangent.tree.equipment_segments
        self._of_people = np.array([name not in equipment for name in tangent.tree.segments], bool)
        sigmas = np.repeat([settings.angular_acceleration_sigma, settings.acceleration_sigma], 3)
        self._root_information = 1.0 / (sigmas * np.sqrt(LASTS_S))

    def _density(self, at: Coordinates, known: Array | None) -> Array:
        """(K, K) spectral density of the coordinates' accelerations, which move every segment.

        Its inverse sums up over segments what their accelerations cost: A eq. 10-11 in joint coordinates.
        """
        J = self._root_information[:, None] * at.jacobians[self._of_people]
        of_rows = J.reshape(-1, self.tangent.count)
        information = of_rows.T @ of_rows
        if known is None:
            return np.asarray(np.linalg.inv(information), np.float64)
        free, density = np.isnan(known), np.diag(np.nan_to_num(known))
        density[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
        return density

    def restarted(self, link: Transition, at: Coordinates, columns: NDArray[np.bool_]) -> Transition:
        """A transition to other coordinates, some columns (K,) of which are initial and without a past."""
        if not columns.any():
            return link
        both, covariance, cross = np.concatenate([columns, columns]), link.after.covariance.copy(), link.cross.copy()
        covariance[both], covariance[:, both], cross[both] = 0.0, 0.0, 0.0
        covariance[both, both] = self._first[both] ** 2
        at = replace(at, velocity=np.where(columns, 0.0, at.velocity))
        return replace(link, after=Estimate(at, covariance), cross=cross)

    def initial(self, motion: Array) -> Estimate:
        """The first state, at motions (1 + J, 4, 4), which its measurements determine alone."""
        at = Coordinates(self.tangent, motion, np.zeros(self.tangent.count))
        return Estimate(at, np.diag(self._first**2))

    def predict(self, before: Estimate, dt_s: float, prior: MotionPrior | None = None) -> Transition:
        """The body ``dt_s`` [s] after a state; ``prior`` of coordinates that do not move as people do."""
        fade_s = self.fade_s if prior is None else prior.fade_s
        Q = self._density(before.at, None if prior is None else prior.density)
        K, keep = self.tangent.count, np.exp(-dt_s / fade_s)
        reach = fade_s * (1.0 - keep)
        at = replace(before.at.moved(reach * before.at.velocity), velocity=keep * before.at.velocity)
        P = before.covariance
        # F = [[1, reach], [0, keep]], by columns.
        cross = np.concatenate([P[:K] + reach[:, None] * P[K:], keep[:, None] * P[K:]])
        covariance = np.concatenate([cross[:, :K] + cross[:, K:] * reach, cross[:, K:] * keep], axis=1)
        covariance[:K, :K] += dt_s**3 / 3.0 * Q
        covariance[:K, K:] += dt_s**2 / 2.0 * Q
        covariance[K:, :K] += dt_s**2 / 2.0 * Q
        covariance[K:, K:] += dt_s * Q
        return Transition(before, Estimate(at, covariance), cross, dt_s, prior)


def predict(world_T_segment_before: Array, world_T_segment: Array, before_s: float, ahead_s: float) -> Array:
    """Poses (S, 4, 4) at the fading velocity of two states.

    Args:
        world_T_segment_before: (S, 4, 4) the earlier poses.
        world_T_segment: (S, 4, 4) the later poses.
        before_s: time between the two [s].
        ahead_s: time to predict [s].
    """
    velocity = log_se3(inverse(world_T_segment_before) @ world_T_segment) / before_s
    poses = world_T_segment @ exp_se3(ahead_s * np.exp(-ahead_s / FADE_S) * velocity)
    return rigid(nearest_rotation(poses[:, :3, :3]), poses[:, :3, 3])
