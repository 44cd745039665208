"""Measurements between two states: rotations of segments, resting soles, accelerations; and both states given these.

A measurement conditions the prediction of the later state, and the earlier one with it.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.estimate import Between, Coordinates, Estimate, Transition
from bodycam_ros.geometry import Array, hat, log_so3
from bodycam_ros.inertial.imu_samples import GRAVITY
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_GRAVITY, _IDENTITY = np.array([0.0, 0.0, -GRAVITY]), np.eye(3)
_TURN_RAD = 0.01  # sigma of a rotation between frames; parallax of near things biases it by tenths of a degree
_FREE_RAD = 0.5  # how far a joint may turn from frame to frame beyond its prediction, where its turn is measured
_ITERATIONS, _NEAR = 2, 0.01  # at most; [rad], [m] of a step after which it is linear enough


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
        by_after, by_before = np.zeros((2, 3, 6))
        by_after[:, :3] = np.eye(3) / self.sigma
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
        moves = np.concatenate([-hat(self.place), np.eye(3)], axis=1)
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
        by_after, by_before = np.zeros((2, 3, 12))
        by_after[:, :3], by_after[:, 9:] = -turned @ hat(u2), turned
        by_before[:, :3], by_before[:, 9:] = hat(velocity), -_IDENTITY
        # In sigmas, by the Cholesky factor (a, 0; b, c) of the covariance of velocity and position along each axis.
        a = math.sqrt(self.density * dt + self.sigma**2)
        of_velocity = (self.velocity - velocity + u1) / a, by_after / a, by_before / a
        if not self.with_position:
            return of_velocity
        moved = after[:3, 3] + R2 @ self.place - before[:3, 3] - R1 @ self.place
        position = R1.T @ (moved - 0.5 * _GRAVITY * dt**2)
        by_after, by_before = np.zeros((2, 3, 12))
        by_after[:, :3], by_after[:, 3:6] = -turned @ lever, turned
        by_before[:, :3] = hat(position) + lever
        by_before[:, 3:6], by_before[:, 9:] = -_IDENTITY, -dt * _IDENTITY
        b = 0.5 * self.density * dt**2 / a
        c = math.sqrt(self.density * dt**3 / 3.0 + 0.25 * (self.sigma * dt) ** 2 - b**2)
        off = self.position - position + u1 * dt
        of_position = (
            (rows - b * known) / c for rows, known in zip((off, by_after, by_before), of_velocity, strict=True)
        )
        left, of_after, of_before = (np.concatenate(each) for each in zip(of_velocity, of_position, strict=True))
        return left, of_after, of_before


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
    rows = {each.row for each in measured if isinstance(each, SegmentTurn)}
    if not rows:
        return link
    tangent, covariance = link.after.at.tangent, link.after.covariance.copy()
    for row, ends in enumerate(tangent.tree.joint_ends.tolist()):
        if rows & set(ends):
            columns = np.arange(*tangent.columns[row].indices(tangent.count))
            covariance[columns, columns] += _FREE_RAD**2 * tangent.twists[row][:3].any(axis=0)
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
        width = H.shape[1]
        if iteration:
            moved = start.step_to(both)
            r += H @ moved[1, :width] + H_before @ moved[0, :width]
        # Covariances of the measured numbers with both states.
        of_after = link.after.covariance[:, :width] @ H.T + link.cross[:, :width] @ H_before.T
        of_before = link.cross[:width].T @ H.T + link.before.covariance[:, :width] @ H_before.T
        S = H @ of_after[:width] + H_before @ of_before[:width] + np.eye(len(r))
        solved = np.linalg.solve(S, np.concatenate([of_after.T, of_before.T, r[:, None]], axis=1))
        gain_after, gain_before, scaled = solved[:, : 2 * K].T, solved[:, 2 * K : 4 * K].T, solved[:, -1]
        steps = np.stack([of_before @ scaled, of_after @ scaled])
        both = start.moved(steps)
        # Nothing measured depends on the other coordinates.
        if np.abs(steps[1, :K][H[:, :K].any(axis=0)]).max(initial=0.0) < _NEAR:
            break
    return replace(
        link,
        before=Estimate(both[0], _lessened(link.before.covariance, gain_before, of_before)),
        after=Estimate(both[1], _lessened(link.after.covariance, gain_after, of_after)),
        cross=_lessened(link.cross, gain_after, of_before),
        between=(*link.between, *measured),
    )


def _lessened(covariance: Array, gain: Array, of_measured: Array) -> Array:
    change = gain @ of_measured.T
    # In place: a new matrix of this size takes ten times as long as its numbers.
    return np.subtract(covariance, change, out=change)


def _linearise(both: Coordinates, measured: Sequence[Between]) -> tuple[Array, Array, Array]:
    """Residuals (M), and Jacobians (M, K) of both states, or (M, 2K) where velocities take part."""
    tangent, rows = both.tangent, [one.row for one in measured]
    if set(rows) == {tangent.root}:
        # Mostly: cameras observe all else.
        rows, poses = [0] * len(rows), both.root[:, None]
        J = np.broadcast_to(np.eye(6, tangent.count), (2, len(rows), 6, tangent.count))
    else:
        poses = both.poses
        J = tangent.segment_jacobians(poses, rows)
    twists = (J @ both.velocity[:, None, :, None])[..., 0]
    each = [
        one.residual(*ends, *spins)
        for one, ends, spins in zip(measured, np.swapaxes(poses[:, rows], 0, 1), np.swapaxes(twists, 0, 1), strict=True)
    ]
    with_velocities = any(by.shape[1] > 6 for _, by, _ in each)

    def stacked(rows: Iterable[Array], jacobians: Array) -> Array:
        blocks = []
        for by, of_pose in zip(rows, jacobians, strict=True):
            parts = [by[:, :6] @ of_pose]
            if with_velocities:
                parts.append(by[:, 6:] @ of_pose if by.shape[1] > 6 else np.zeros_like(parts[0]))
            blocks.append(np.concatenate(parts, axis=1))
        return np.concatenate(blocks)

    H_before, H = stacked((by for _, _, by in each), J[0]), stacked((by for _, by, _ in each), J[1])
    return np.concatenate([left for left, _, _ in each]), H_before, H
