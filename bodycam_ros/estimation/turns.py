"""Rotations of segments between two images of their cameras (A eq. 2 and the second term of eq. 8).

They measure two instants at once, so they condition the prediction of the later instant and the earlier one with it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.estimation.belief import Belief, Link
from bodycam_ros.geometry import Array, log_so3
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.registration.landmark_matches import LandmarkMatches


@dataclass(frozen=True, eq=False)
class SegmentTurn:
    """The rotation of a segment since the instant before.

    Attributes:
        row: of the segment.
        previous_R_segment: (3, 3).
        sigma: of it [rad].
    """

    row: int
    previous_R_segment: Array
    sigma: float


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


def turned(link: Link, turns: Sequence[SegmentTurn], tangent: TreeTangent) -> Link:
    """The same two instants given the rotations between them (extended Kalman update of both)."""
    if not turns:
        return link
    K = tangent.count
    before, after = link.before.at, link.after.at
    poses, poses_before = after.poses(tangent), before.poses(tangent)
    J, J_before = tangent.segment_jacobians(poses), tangent.segment_jacobians(poses_before)
    H, H_before, r = np.zeros((3 * len(turns), K)), np.zeros((3 * len(turns), K)), np.zeros(3 * len(turns))
    for number, turn in enumerate(turns):
        at = slice(3 * number, 3 * number + 3)
        previous_R_now = poses_before[turn.row, :3, :3].T @ poses[turn.row, :3, :3]
        r[at] = log_so3(previous_R_now.T @ turn.previous_R_segment) / turn.sigma
        H[at] = J[turn.row, :3] / turn.sigma
        H_before[at] = -previous_R_now.T @ J_before[turn.row, :3] / turn.sigma
    # Covariances of the measured numbers with both instants.
    of_after = link.after.covariance[:, :K] @ H.T + link.cross[:, :K] @ H_before.T
    of_before = link.cross[:K].T @ H.T + link.before.covariance[:, :K] @ H_before.T
    S = H @ of_after[:K] + H_before @ of_before[:K] + np.eye(len(r))
    solved = np.linalg.solve(S, np.concatenate([of_after.T, of_before.T, r[:, None]], axis=1))
    gain_after, gain_before, scaled = solved[:, : 2 * K].T, solved[:, 2 * K : 4 * K].T, solved[:, -1]
    return Link(
        Belief(before.moved(tangent, of_before @ scaled), link.before.covariance - gain_before @ of_before.T),
        Belief(after.moved(tangent, of_after @ scaled), link.after.covariance - gain_after @ of_after.T),
        link.cross - gain_after @ of_before.T,
    )
