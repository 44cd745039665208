"""Measurements between two states: rotations of segments, resting soles, accelerations; and both states given these.

A measurement conditions the prediction of the later state, and the earlier one with it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.estimate import FREE_RAD, SETTLED, Between, Coordinates, Estimate, Transition
from bodycam_ros.geometry import Array, hat, log_so3
from bodycam_ros.inertial.imu_samples import GRAVITY
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_GRAVITY, _IDENTITY = np.array([0.0, 0.0, -GRAVITY]), np.eye(3)
_TURN_RAD = 0.01  # sigma of a rotation between frames; parallax of near things biases it by tenths of a degree
_ITERATIONS = 2  # at most


@dataclass(frozen=True, eq=False)
class SegmentTurn:
    """The rotation of a segment since the state before (A eq. 2 and the second term of eq. 8).

    Attributes:
        row: of the segment.
        previous_R_segment: (3, 3).
        sigma: of it [rad].
    """

    row: int
    previous_R_segment: Array
    sigma: float

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """See ``Between``."""
        previous_R_now = before[:3, :3].T @ after[:3, :3]
        r = log_so3(previous_R_now.T @ self.previous_R_segment) / self.sigma
        by_after, by_before = np.zeros((2, 3, 12))
        by_after[:, :3] = _IDENTITY / self.sigma
        by_before[:, :3] = -previous_R_now.T / self.sigma
        return r, by_after, by_before


@dataclass(frozen=True, eq=False)
class RestingPoint:
    """A point of a sole that is where it was in the state before.

    Attributes:
        row: of the foot.
        place: (3,) of the point in the foot [m].
        sigma: of its displacement in the world [m].
    """

    row: int
    place: Array
    sigma: float

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """See ``Between``."""
        left = (before[:3, :3] - after[:3, :3]) @ self.place + before[:3, 3] - after[:3, 3]
        moves = np.concatenate([-hat(self.place), _IDENTITY, np.zeros((3, 6))], axis=1)
        return left / self.sigma, after[:3, :3] @ moves / self.sigma, -before[:3, :3] @ moves / self.sigma


@dataclass(frozen=True, eq=False)
class InertialStep:
    """Change of velocity and place of a sensor on a segment by its accelerometer (Forster et al. 2017, eq. 45).

    Attributes:
        row: of the segment.
        place: (3,) of the sensor on the segment [m].
        seconds: between the two states.
        velocity, position: (3,) preintegrated, in the segment's axes at the first [m/s], [m].
        spin_before, spin_after: (3,) angular velocities of the segment at both, in its axes [rad/s].
        density: spectral density of the acceleration's error [m^2/s^3].
        sigma: of the change of velocity, beside that [m/s].
        with_position: whether the change of place is used; cameras that observe the segment measure it better.
    """

    row: int
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
        """See ``Between``."""
        dt, lever, R1, R2 = self.seconds, hat(self.place), before[:3, :3], after[:3, :3]
        u1, u2 = (
            twist[3:] - lever @ spin for twist, spin in zip(twists, (self.spin_before, self.spin_after), strict=True)
        )
        velocity, turned = R1.T @ (R2 @ u2 - _GRAVITY * dt), R1.T @ R2
        moved = after[:3, 3] + R2 @ self.place - before[:3, 3] - R1 @ self.place
        position = R1.T @ (moved - 0.5 * _GRAVITY * dt**2)
        r = np.concatenate([self.velocity - velocity + u1, self.position - position + u1 * dt])
        by_after, by_before = np.zeros((2, 6, 12))
        by_after[:3, :3], by_after[:3, 9:] = -turned @ hat(u2), turned
        by_before[:3, :3], by_before[:3, 9:] = hat(velocity), -_IDENTITY
        by_after[3:, :3], by_after[3:, 3:6] = -turned @ lever, turned
        by_before[3:, :3], by_before[3:, 3:6], by_before[3:, 9:] = hat(position) + lever, -_IDENTITY, -dt * _IDENTITY
        # Of velocity and position along each axis.
        of_noise = self.density * np.array([[dt, dt**2 / 2.0], [dt**2 / 2.0, dt**3 / 3.0]])
        covariance = of_noise + self.sigma**2 * np.diag([1.0, 0.25 * dt**2])
        W = np.kron(np.linalg.inv(np.linalg.cholesky(covariance)), _IDENTITY)[: 6 if self.with_position else 3]
        return W @ r, W @ by_after, W @ by_before


def measured_turns(
    body: BodyModel, matches: Iterable[LandmarkMatches], before_ns: Mapping[str, int], needed: NDArray[np.bool_]
) -> list[SegmentTurn]:
    """The rotations that cameras measured since the state before.

    Args:
        body: that carries them.
        matches: of their images.
        before_ns: camera -> stamp of its image at the state before; by their own stamps, for each may run freely.
        needed: (S,) segments whose rotation is used.
    """
    turns = []
    for each in matches:
        mount = body.mounts.get(each.camera)
        if mount is None or each.rotation_inliers == 0 or before_ns.get(each.camera) != each.previous_stamp_ns:
            continue
        row = body.segment_index[mount.segment]
        if needed[row]:
            segment_R_camera = mount.segment_T_camera[:3, :3]
            turns.append(SegmentTurn(row, segment_R_camera @ each.current_R_previous.T @ segment_R_camera.T, _TURN_RAD))
    return turns


def _loosen_joints(link: Transition, measured: Sequence[Between]) -> Transition:
    """The same, but joints beside segments whose rotations are measured move by these alone.

    Smooth motion of joints, and rotations of both of their segments, would determine the angle between them (as of a
    hand and an eye). Limbs do not swing by chance, so it would be wrong, and surely so.
    """
    rows = [each.row for each in measured if isinstance(each, SegmentTurn)]
    if not rows:
        return link
    tangent, covariance = link.after.at.tangent, link.after.covariance.copy()
    beside = np.asarray(np.isin(tangent.tree.joint_ends, rows).any(axis=1), bool)
    columns = tangent.columns_of(beside) & tangent.turns
    covariance[: tangent.count, : tangent.count][columns, columns] += FREE_RAD**2
    return replace(link, after=Estimate(link.after.at, covariance))


def condition(link: Transition, measured: Sequence[Between]) -> Transition:
    """The same two states given measurements between them (iterated extended Kalman update of both).

    It is repeated about its outcome: a limb that is observed again may be far from its prediction, and what is smoothed
    back by as much must turn as it was measured.
    """
    if not measured:
        return link
    link, K = _loosen_joints(link, measured), link.after.at.tangent.count
    both = start = Coordinates.stacked(link.before.at, link.after.at)
    for iteration in range(_ITERATIONS):
        r, H_before, H = _linearise(both, measured)
        if iteration:
            moved = start.step_to(both)
            r += H @ moved[1] + H_before @ moved[0]
        # Covariances of the measured numbers with both states.
        of_after = link.after.covariance @ H.T + link.cross @ H_before.T
        of_before = link.cross.T @ H.T + link.before.covariance @ H_before.T
        S = H @ of_after + H_before @ of_before + np.eye(len(r))
        solved = np.linalg.solve(S, np.concatenate([of_after.T, of_before.T, r[:, None]], axis=1))
        gain_after, gain_before, scaled = solved[:, : 2 * K].T, solved[:, 2 * K : 4 * K].T, solved[:, -1]
        steps = np.stack([of_before @ scaled, of_after @ scaled])
        both = start.moved(steps)
        # Nothing measured depends on the other coordinates.
        if np.abs(steps[1, :K][H[:, :K].any(axis=0)]).max(initial=0.0) < SETTLED:
            break
    return replace(
        link,
        # The state before has this covariance as well, and needs it as it was to be smoothed.
        before=Estimate(both[0], link.before.covariance - gain_before @ of_before.T),
        after=Estimate(both[1], _lessened(link.after.covariance, gain_after, of_after)),
        cross=_lessened(link.cross, gain_after, of_before),
        between=(*link.between, *measured),
    )


def _lessened(covariance: Array, gain: Array, of_measured: Array) -> Array:
    change = gain @ of_measured.T
    # In place: a new matrix of this size takes ten times as long as its numbers.
    return np.subtract(covariance, change, out=change)


def _linearise(both: Coordinates, measured: Sequence[Between]) -> tuple[Array, Array, Array]:
    """Residuals (M), and how increments (2K) of the earlier and of the later state lessen them: (M, 2K) each."""
    rows = [one.row for one in measured]
    poses, J = both.poses[:, rows], both.tangent.segment_jacobians(both.poses, rows)
    twists = (J @ both.velocity[:, None, :, None])[..., 0]
    residuals, by_before, by_after = list[Array](), list[Array](), list[Array]()
    for i, one in enumerate(measured):
        r, of_after, of_before = one.residual(*poses[:, i], *twists[:, i])
        residuals.append(r)
        for rows_of, of_segment, jacobian in ((by_before, of_before, J[0, i]), (by_after, of_after, J[1, i])):
            rows_of.append(np.concatenate([of_segment[:, :6] @ jacobian, of_segment[:, 6:] @ jacobian], axis=1))
    return np.concatenate(residuals), np.concatenate(by_before), np.concatenate(by_after)
