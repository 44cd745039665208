"""What is measured of two instants at once: turns of segments between images, points of soles that stand.

A measurement of both conditions the prediction of the later instant, and the earlier one with it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.belief import Belief, Link
from bodycam_ros.geometry import Array, hat, log_so3
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.registration.landmark_matches import LandmarkMatches

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
class StandingPoint:
    """A point of a sole that is where it was at the instant before, or where it came to stand.

    Attributes:
        row: of the foot.
        place: (3,) of the point in the foot [m].
        whitening: (3, 3) of its way in the world [1/m].
        anchor: (3,) where it stands in the world [m]; None for where it was.
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


Between = SegmentTurn | StandingPoint
"""A measurement of one segment at two instants.

Its residual (M) is in sigmas. With it come the rows (M, 6) by which tangents of the later pose, and of the earlier one,
lessen it.
"""


def turns_since(
    body: BodyModel,
    matches: Iterable[LandmarkMatches],
    before_ns: Mapping[str, int],
    unseen: Callable[[str, int], bool],
    sigma: float,
) -> list[SegmentTurn]:
    """The rotations that cameras measured since the instant before.

    Args:
        body: that carries them.
        matches: of their images.
        before_ns: camera -> stamp of its image at the instant before; by their own stamps, for each may run freely.
        unseen: whether a camera's segment, in a row, needs its turn.
        sigma: of a rotation [rad].
    """
    turns = []
    for each in matches:
        mount = body.mounts.get(each.camera)
        if mount is None or each.rotation_inliers == 0 or before_ns.get(each.camera) != each.previous_stamp_ns:
            continue
        row = body.segment_index[mount.segment]
        if unseen(each.camera, row):
            segment_R_camera = mount.segment_T_camera[:3, :3]
            turns.append(SegmentTurn(row, segment_R_camera @ each.current_R_previous.T @ segment_R_camera.T, sigma))
    return turns


def freed(link: Link, turns: Sequence[SegmentTurn], tangent: TreeTangent) -> Link:
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
    return Link(link.before, Belief(link.after.at, covariance), link.cross)


def given(link: Link, measured: Sequence[Between], tangent: TreeTangent) -> Link:
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
    return Link(
        Belief(before, link.before.covariance - gain_before @ of_before.T),
        Belief(after, link.after.covariance - gain_after @ of_after.T),
        link.cross - gain_after @ of_before.T,
    )
