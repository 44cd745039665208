"""A change of velocity and place by an accelerometer (Forster et al. 2017, eq. 45)."""

from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array, hat
from bodycam_ros.inertial.imu_samples import GRAVITY

_GRAVITY, _IDENTITY = np.array([0.0, 0.0, -GRAVITY]), np.eye(3)


@dataclass(frozen=True, eq=False)
class InertialStep:
    """Change of velocity and place of a sensor on a segment by its accelerometer (Forster et al. 2017, eq. 45).

    Attributes:
        segment: row of the segment.
        place: (3,) of the sensor on the segment [m].
        seconds: between the two states.
        velocity, position: (3,) preintegrated, in the segment's axes at the first [m/s], [m].
        spin_before, spin_after: (3,) angular velocities of the segment at both, in its axes [rad/s].
        density: spectral density of the acceleration's error [m^2/s^3].
        sigma: of the change of velocity, beside that [m/s].
        with_position: whether the change of place is used; cameras that observe the segment measure it better.
    """

    segment: int
    place: Array
    seconds: float
    velocity: Array
    position: Array
    spin_before: Array
    spin_after: Array
    density: float
    sigma: float
    with_position: bool

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """See ``SegmentStep``."""
        dt = self.seconds
        lever = hat(self.place)
        R1 = before[:3, :3]
        R2 = after[:3, :3]
        u1, u2 = (
            twist[3:] - lever @ spin for twist, spin in zip(twists, (self.spin_before, self.spin_after), strict=True)
        )
        velocity, turned = R1.T @ (R2 @ u2 - _GRAVITY * dt), R1.T @ R2
        moved = after[:3, 3] + R2 @ self.place - before[:3, 3] - R1 @ self.place
        position = R1.T @ (moved - 0.5 * _GRAVITY * dt**2)
        off = np.concatenate([velocity - u1 - self.velocity, position - u1 * dt - self.position])
        by_after, by_before = np.zeros((2, 6, 12))
        by_after[:3, :3], by_after[:3, 9:] = -turned @ hat(u2), turned
        by_before[:3, :3], by_before[:3, 9:] = hat(velocity), -_IDENTITY
        by_after[3:, :3], by_after[3:, 3:6] = -turned @ lever, turned
        by_before[3:, :3], by_before[3:, 3:6], by_before[3:, 9:] = hat(position) + lever, -_IDENTITY, -dt * _IDENTITY
        # Covariance of velocity and position along each axis.
        of_noise = self.density * np.array([[dt, dt**2 / 2.0], [dt**2 / 2.0, dt**3 / 3.0]])
        covariance = of_noise + self.sigma**2 * np.diag([1.0, 0.25 * dt**2])
        W = np.kron(np.linalg.inv(np.linalg.cholesky(covariance)), _IDENTITY)[: 6 if self.with_position else 3]
        return W @ off, W @ by_before, W @ by_after
