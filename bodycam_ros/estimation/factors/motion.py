"""The motion prior: a white-noise acceleration of every coordinate, on velocities that fade (A eq. 10-11, altered).

The paper penalises the change of pose between frames. That pulls every motion towards standing still; we penalise the
change of velocity, whose size in people is known: accelerations of limbs in m/s^2 and rad/s^2.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.coordinates import FREE_RAD, UNKNOWN, Chart, Coordinates
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, nearest_rotation, rigid
from bodycam_ros.kinematics.tangent import TreeTangent

Mask = NDArray[np.bool_]

FADE_S = 0.2  # in which an unobserved velocity fades: a blind limb comes to rest instead of flying off
LASTS_S = 0.033  # how long an acceleration lasts: with it a standard deviation becomes a spectral density
FIRST_SPEED = 4.0  # [rad/s], [m/s] sigma of people, before the motion is known
CONSTANT = 1e-9  # [m^2/s^3] least density: a length that stays wanders by 6 um in a second, and has an inverse


class MotionPrior(NamedTuple):
    """Motion prior of coordinates that do not belong to the person.

    Attributes:
        density: (K) spectral densities of their accelerations; NaN of coordinates that move as people do.
        fade_s: (K) in which velocities fade [s].
    """

    density: Array
    fade_s: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion prior between two states.

    Its error is the velocity of the later state from the faded one before, then the increment from where that leads to
    the later coordinates: A eq. 10-11 with velocities in place of poses. Increments of the two states are compared as
    they are: with those before turned by the motion (the adjoint, which is the exact derivative) half a second without
    images errs by 10.0 deg instead of 8.6, over eleven such gaps. So the factor is linear, and gtsam's own.

    Attributes:
        dt_s: between the states [s].
        fade_s: (K) in which velocities fade [s].
        density_root: (K, K) upper triangular square root of the inverse density of accelerations.
        kept: (2K) rows of the error that hold; the others are of coordinates that begin anew.
        loose: (K) coordinates that move by what is measured of them alone.
    """

    dt_s: float
    fade_s: Array
    density_root: Array
    kept: Mask
    loose: Mask

    @property
    def _keeps(self) -> tuple[Array, Array]:
        """(K) share of a velocity that is left, and the time [s] in which the whole would lead as far."""
        keep = np.exp(-self.dt_s / self.fade_s)
        return keep, self.fade_s * (1.0 - keep)

    def predict(self, before: Coordinates) -> Coordinates:
        """The later state where no acceleration changes the motion."""
        keep, reach_s = self._keeps
        return replace(before.moved(reach_s * before.velocity), velocity=keep * before.velocity)

    def error(self, before: Coordinates, after: Coordinates) -> Array:
        """(M) kept errors, in sigmas."""
        predicted = self.predict(before)
        off = np.concatenate([after.velocity - predicted.velocity, predicted.step_to(after)])
        return np.asarray(self._square_root @ off[self.kept], np.float64)

    @cached_property
    def jacobians(self) -> tuple[Array, Array]:
        """(M, 2K) how the error changes with velocities and increments of the earlier, and of the later state."""
        K, (keep, reach_s), W = len(self.fade_s), self._keeps, self._square_root
        by_after = np.zeros((len(W), 2 * K))
        by_after[:, self.kept] = W
        of_velocity, of_step = by_after[:, :K], by_after[:, K:]
        return np.concatenate([-of_velocity * keep - of_step * reach_s, -of_step], axis=1), by_after

    @cached_property
    def _square_root(self) -> Array:
        """(M, M) square root of the information of the kept errors: of a white-noise acceleration."""
        dt_s, root = self.dt_s, self.density_root
        # The covariance is [[dt, dt^2 / 2], [dt^2 / 2, dt^3 / 3]] times the density; its inverse has this square root.
        scale = np.array([[2.0, -3.0 / dt_s], [0.0, np.sqrt(3.0) / dt_s]]) / np.sqrt(dt_s)
        if self.kept.all() and not self.loose.any():
            return np.kron(scale, root)
        inverse_root = np.kron(np.linalg.inv(scale), np.linalg.inv(root))
        covariance = inverse_root @ inverse_root.T
        free = np.append(np.zeros(len(self.loose)), np.where(self.loose, FREE_RAD**2, 0.0))
        covariance += np.diag(free)
        lower = np.linalg.cholesky(covariance[np.ix_(self.kept, self.kept)])
        return np.asarray(np.linalg.inv(lower), np.float64)

    def factor(self, keys: tuple[int, int], charts: tuple[Chart, Chart]) -> gtsam.NonlinearFactor:
        """The factor of two states, linear in their vectors."""
        error, (by_before, by_after) = self.error(*(chart.origin for chart in charts)), self.jacobians
        unit, origins = gtsam.noiseModel.Unit.Create(len(error)), gtsam.Values()
        for key, chart in zip(keys, charts, strict=True):
            origins.insert(key, np.zeros(2 * chart.size))
        linear = gtsam.JacobianFactor(keys[0], by_before, keys[1], by_after, -error, unit)
        return gtsam.LinearContainerFactor(linear, origins)

    def restarted(self, columns: Mask) -> "Motion":
        """The same, but nothing of the state before holds for some coordinates (K)."""
        return replace(self, kept=self.kept & ~np.concatenate([columns, columns]))

    def loosened(self, columns: Mask) -> "Motion":
        """The same, but some coordinates (K) move by what is measured of them alone.

        Smooth motion of joints, and rotations of both of their segments, would determine the angle between them (as of
        a hand and an eye). Limbs do not swing by chance, so it would be wrong, and surely so.
        """
        return replace(self, loose=self.loose | columns)


class MotionModel:
    """How a body moves.

    Args:
        tangent: its coordinates.
        settings: how suddenly people change their motion.

    Attributes:
        tangent: as given.
        first_sigmas: (2K) of velocities, then coordinates, that nothing is known of.
    """

    def __init__(self, tangent: TreeTangent, settings: MotionSettings) -> None:
        self.tangent = tangent
        self.first_sigmas = np.append(np.full(tangent.count, FIRST_SPEED), np.full(tangent.count, UNKNOWN))
        self._fade_s = np.full(tangent.count, FADE_S)
        equipment = tangent.tree.equipment_segments
        self._of_people = np.array([name not in equipment for name in tangent.tree.segments], bool)
        sigmas = np.repeat([settings.angular_acceleration_sigma, settings.acceleration_sigma], 3)
        self._root_information = 1.0 / (sigmas * np.sqrt(LASTS_S))

    def between(self, before: Coordinates, dt_s: float, prior: MotionPrior | None = None) -> Motion:
        """The motion prior from a state to ``dt_s`` [s] later; ``prior`` of coordinates that do not move as people."""
        K, fade_s = self.tangent.count, self._fade_s if prior is None else prior.fade_s
        # What accelerations of all segments cost: A eq. 10-11 in joint coordinates.
        J = (self._root_information[:, None] * before.jacobians[self._of_people]).reshape(-1, K)
        information = J.T @ J
        if prior is not None:
            known = ~np.isnan(prior.density)
            information[known], information[:, known] = 0.0, 0.0
            information[known, known] = 1.0 / np.maximum(prior.density[known], CONSTANT)
        root = np.linalg.cholesky(information).T
        return Motion(dt_s, fade_s, root, np.ones(2 * K, bool), np.zeros(K, bool))


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
