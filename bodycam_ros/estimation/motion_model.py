"""The motion prior: a white-noise acceleration of every coordinate, on velocities that fade (A eq. 10-11 with units).

The paper penalises the change of pose between frames. That pulls every motion towards standing still; we penalise the
change of velocity, whose size in people is known: accelerations of limbs in m/s^2 and rad/s^2.

A measurement of both conditions the prediction of the later instant, and the earlier one with it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.estimate import Coordinates, Estimate, Transition
from bodycam_ros.geometry import Array, exp_se3, hat, inverse, log_se3, log_so3, nearest_rotation
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting

FADE_S = 0.2  # in which an unobserved velocity fades: a blind limb comes to rest instead of flying off
_TURN_RAD = 0.01  # sigma of a rotation between frames; parallax of near things biases it by tenths of a degree
LASTS_S = 0.033
"""How long an acceleration lasts: with it a standard deviation becomes a spectral density."""

_FIRST_SPEEDS = np.repeat([6.0, 2.0], 3)
"""[rad/s], [m/s] of people, before anything is known of the motion."""

_FIRST_POSES = np.repeat([1.0, 1.0], 3)
"""[rad], [m] a body that begins is known by its measurements alone."""


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
        fade_s: (K) in which velocities fade.
    """

    def __init__(self, tangent: TreeTangent, settings: MotionSettings) -> None:
        self._tangent = tangent
        turns = np.concatenate([np.ones(3), np.zeros(3), *[xi[:3].any(axis=0) for xi in tangent.twists]])
        self.fade_s = np.full(tangent.count, FADE_S)
        self._first = np.concatenate(
            [np.where(turns > 0.0, *_FIRST_POSES[[0, 3]]), np.where(turns > 0.0, *_FIRST_SPEEDS[[0, 3]])]
        )
        equipment = tangent.tree.equipment_segments
        self._of_people = np.array([name not in equipment for name in tangent.tree.segments], bool)
        sigmas = np.repeat([settings.angular_acceleration_sigma, settings.acceleration_sigma], 3)
        self._root_information = 1.0 / (sigmas * np.sqrt(LASTS_S))

    def _density(self, poses: Array, known: Array | None) -> Array:
        """(K, K) spectral density of the coordinates' accelerations, at poses (S, 4, 4), which move every segment.

        Its inverse sums up over segments what their accelerations cost: A eq. 10-11 in joint coordinates.
        """
        J = self._root_information[:, None] * self._tangent.segment_jacobians(poses)[self._of_people]
        of_rows = J.reshape(-1, self._tangent.count)
        information = of_rows.T @ of_rows
        if known is None:
            return np.asarray(np.linalg.inv(information), np.float64)
        free, density = np.isnan(known), np.diag(np.nan_to_num(known))
        density[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
        return density

    def restarted(self, estimate: Estimate, at: Coordinates, columns: NDArray[np.bool_]) -> Estimate:
        """The estimate about other coordinates, of which some columns (K,) begin anew."""
        both = np.concatenate([columns, columns])
        covariance = estimate.covariance.copy()
        covariance[both], covariance[:, both] = 0.0, 0.0
        covariance[both, both] = self._first[both] ** 2
        return Estimate(Coordinates(at.root, at.motion, np.where(columns, 0.0, at.velocity)), covariance)

    def initial(self, root: Array, motion: Array) -> Estimate:
        """A body that begins at a pose (4, 4) and joint motions (J, 4, 4): known by its measurements alone."""
        at = Coordinates(root, motion, np.zeros(self._tangent.count))
        return Estimate(at, np.diag(self._first**2))

    def predict(
        self, before: Estimate, dt_s: float, density: Array | None = None, fade_s: Array | None = None
    ) -> Transition:
        """The body ``dt_s`` later.

        Args:
            before: the instant before.
            dt_s: [s].
            density: (K) of coordinates that do not move as people do; NaN of those that do.
            fade_s: (K) in which velocities fade, where it is not people's.
        """
        fade_s = self.fade_s if fade_s is None else fade_s
        Q = self._density(before.at.poses(self._tangent), density)
        K, keep = self._tangent.count, np.exp(-dt_s / fade_s)
        reach = fade_s * (1.0 - keep)
        at = before.at.moved(self._tangent, reach * before.at.velocity)
        at = Coordinates(at.root, at.motion, keep * before.at.velocity)
        P = before.covariance
        # F = [[1, reach], [0, keep]], by columns.
        cross = np.concatenate([P[:K] + reach[:, None] * P[K:], keep[:, None] * P[K:]])
        covariance = np.concatenate([cross[:, :K] + cross[:, K:] * reach, cross[:, K:] * keep], axis=1)
        covariance += np.kron([[dt_s**3 / 3.0, dt_s**2 / 2.0], [dt_s**2 / 2.0, dt_s]], Q)
        return Transition(before, Estimate(at, covariance), cross)


def predict(world_T_segment_before: Array, world_T_segment: Array, before_s: float, ahead_s: float) -> Array:
    """Poses (S, 4, 4) at the fading velocity of poses at two instants.

    Args:
        world_T_segment_before: (S, 4, 4) the earlier poses.
        world_T_segment: (S, 4, 4) the later poses.
        before_s: time between the two [s].
        ahead_s: time to predict [s].
    """
    velocity = log_se3(inverse(world_T_segment_before) @ world_T_segment) / before_s
    return orthonormal(world_T_segment @ exp_se3(ahead_s * np.exp(-ahead_s / FADE_S) * velocity))


def motion_sigmas(dt_s: float | Array, previous_dt_s: float | Array, settings: MotionSettings) -> Array:
    """Sigmas (6), rotation [rad] then translation [m], of a segment's deviation from the prediction; (N, 6) of (N, 1).

    The mean velocity over ``dt_s`` differs from the one over ``previous_dt_s`` by the acceleration times half of both.
    """
    sigmas = [settings.angular_acceleration_sigma, settings.acceleration_sigma]
    return np.asarray(np.repeat(sigmas, 3) * dt_s * 0.5 * (dt_s + previous_dt_s))


def orthonormal(poses: Array) -> Array:
    """Poses (S, 4, 4) with rotations put back onto SO(3)."""
    mended = poses.copy()
    mended[:, :3, :3] = nearest_rotation(poses[:, :3, :3])
    return mended


_FREE_RAD = 0.5
"""How far a joint may turn from image to image, beyond what is expected."""

_ITERATIONS, _NEAR = 2, 0.01  # times; [rad], [m] of a step after which it is linear enough


@dataclass(frozen=True, eq=False)
class SegmentTurn:
    """The rotation of a segment since the instant before (A eq. 2 and the second term of eq. 8).

    Attributes:
        row: of the segment.
        previous_R_segment: (3, 3).
        sigma: of it [rad].
    """

    row: int
    previous_R_segment: Array
    sigma: float

    def residual(self, before: Array, after: Array) -> tuple[Array, Array, Array]:
        """See ``Between``."""
        previous_R_now = before[:3, :3].T @ after[:3, :3]
        r = log_so3(previous_R_now.T @ self.previous_R_segment) / self.sigma
        by_after, by_before = np.zeros((2, 3, 6))
        by_after[:, :3] = np.eye(3) / self.sigma
        by_before[:, :3] = -previous_R_now.T / self.sigma
        return r, by_after, by_before


@dataclass(frozen=True, eq=False)
class RestingPoint:
    """A point of a sole that is where it was in the state before, or where it came to rest.

    Attributes:
        row: of the foot.
        place: (3,) of the point in the foot [m].
        whitening: (3, 3) of its displacement in the world [1/m].
        anchor: (3,) where it rests in the world [m]; None: where it was.
    """

    row: int
    place: Array
    whitening: Array
    anchor: Array | None

    def residual(self, before: Array, after: Array) -> tuple[Array, Array, Array]:
        """See ``Between``."""
        was = self._point(before) if self.anchor is None else self.anchor
        by_before = -self._moves(before) if self.anchor is None else np.zeros((3, 6))
        left, by_after = was - self._point(after), self._moves(after)
        return self.whitening @ left, self.whitening @ by_after, self.whitening @ by_before

    def _point(self, pose: Array) -> Array:
        point: Array = pose[:3, :3] @ self.place + pose[:3, 3]
        return point

    def _moves(self, pose: Array) -> Array:
        moves: Array = pose[:3, :3] @ np.concatenate([-hat(self.place), np.eye(3)], axis=1)
        return moves


Between = SegmentTurn | RestingPoint
"""A measurement of one segment at two instants.

Its residual (M) is in sigmas. With it come the rows (M, 6) by which tangents of the later pose, and of the earlier one,
lessen it.
"""


def measured_turns(
    body: BodyModel,
    matches: Iterable[LandmarkMatches],
    before_ns: Mapping[str, int],
    needs_turn: Callable[[str, int], bool],
) -> list[SegmentTurn]:
    """The rotations that cameras measured since the instant before.

    Args:
        body: that carries them.
        matches: of their images.
        before_ns: camera -> stamp of its image at the instant before; by their own stamps, for each may run freely.
        needs_turn: whether the rotation of a camera's segment, in a row, is used.
    """
    turns = []
    for each in matches:
        mount = body.mounts.get(each.camera)
        if mount is None or each.rotation_inliers == 0 or before_ns.get(each.camera) != each.previous_stamp_ns:
            continue
        row = body.segment_index[mount.segment]
        if needs_turn(each.camera, row):
            segment_R_camera = mount.segment_T_camera[:3, :3]
            turns.append(SegmentTurn(row, segment_R_camera @ each.current_R_previous.T @ segment_R_camera.T, _TURN_RAD))
    return turns


def loosen_joints(link: Transition, turns: Sequence[SegmentTurn], tangent: TreeTangent) -> Transition:
    """The same, but how the joints beside segments whose turns are measured move is told by these alone.

    Smooth motion of joints, and turns of both of their segments, would tell the angle between them (as of a hand and
    an eye). Limbs do not swing by chance, so it would be wrong, and surely so.
    """
    if not turns:
        return link
    rows = {turn.row for turn in turns}
    covariance = link.after.covariance.copy()
    for row, joint in enumerate(tangent.tree.tree_joints):
        if tangent.tree.segment_index[joint.child] in rows or tangent.tree.segment_index[joint.parent] in rows:
            columns = np.arange(*tangent.columns[row].indices(tangent.count))
            covariance[columns, columns] += _FREE_RAD**2 * tangent.twists[row][:3].any(axis=0)
    return Transition(link.before, Estimate(link.after.at, covariance), link.cross)


def condition(link: Transition, measured: Sequence[Between], tangent: TreeTangent) -> Transition:
    """The same two instants given what is measured between them (iterated extended Kalman update of both).

    It is repeated about its outcome: a limb that is seen again may be far from where it was expected, and what is
    smoothed back by as much must turn as it was measured.
    """
    if not measured:
        return link
    K = tangent.count
    before, after = link.before.at, link.after.at
    for _ in range(_ITERATIONS):
        poses, poses_before = after.poses(tangent), before.poses(tangent)
        J, J_before = tangent.segment_jacobians(poses), tangent.segment_jacobians(poses_before)
        each = [one.residual(poses_before[one.row], poses[one.row]) for one in measured]
        H = np.concatenate([by @ J[one.row] for one, (_, by, _) in zip(measured, each, strict=True)])
        H_before = np.concatenate([by @ J_before[one.row] for one, (_, _, by) in zip(measured, each, strict=True)])
        r = np.concatenate([left for left, _, _ in each])
        r += H @ link.after.at.step_to(tangent, after)[:K] + H_before @ link.before.at.step_to(tangent, before)[:K]
        # Covariances of the measured numbers with both instants.
        of_after = link.after.covariance[:, :K] @ H.T + link.cross[:, :K] @ H_before.T
        of_before = link.cross[:K].T @ H.T + link.before.covariance[:, :K] @ H_before.T
        S = H @ of_after[:K] + H_before @ of_before[:K] + np.eye(len(r))
        solved = np.linalg.solve(S, np.concatenate([of_after.T, of_before.T, r[:, None]], axis=1))
        gain_after, gain_before, scaled = solved[:, : 2 * K].T, solved[:, 2 * K : 4 * K].T, solved[:, -1]
        before = link.before.at.moved(tangent, of_before @ scaled)
        after = link.after.at.moved(tangent, step := of_after @ scaled)
        if np.abs(step[:K]).max() < _NEAR:
            break
    return Transition(
        Estimate(before, link.before.covariance - gain_before @ of_before.T),
        Estimate(after, link.after.covariance - gain_after @ of_after.T),
        link.cross - gain_after @ of_before.T,
    )
