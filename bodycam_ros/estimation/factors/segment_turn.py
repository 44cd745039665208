"""The rotation of a segment since the state before (A eq. 2, and the second term of A eq. 8)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, log_jacobian, log_so3
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_TURN_RAD = 0.01  # sigma of a rotation between frames; parallax of near things biases it by tenths of a degree


@dataclass(frozen=True, eq=False)
class SegmentTurn:
    """The rotation of a segment between two states: log(measured^T turned) in sigmas.

    Attributes:
        segment: row of the segment.
        previous_R_segment: (3, 3).
        sigma: of it [rad].
    """

    segment: int
    previous_R_segment: Array
    sigma: float

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """See ``SegmentStep``."""
        previous_R_now = before[:3, :3].T @ after[:3, :3]
        off = log_so3(self.previous_R_segment.T @ previous_R_now)
        by_before, by_after = np.zeros((2, 3, 12))
        by_after[:, :3] = log_jacobian(-off) / self.sigma
        by_before[:, :3] = -by_after[:, :3] @ previous_R_now.T
        return off / self.sigma, by_before, by_after


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
