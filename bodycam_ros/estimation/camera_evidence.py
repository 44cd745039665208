"""What one camera says about the segment that carries it, as a pose with its information (DESIGN 4.2).

A registered camera gives an absolute pose (A eq. 8, first term).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.geometry import adjoint, inverse
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class EvidenceSettings:
    """How far a camera is trusted."""

    mount_rotation_sigma: float = setting(
        0.0004,
        unit="rad",
        limits=(0.0, 0.1),
        reason="map, lens and strap err together, however many landmarks agree: the floor of a registration's rotation",
    )
    mount_translation_sigma: float = setting(0.001, unit="m", limits=(0.0, 0.1), reason="the same for its position")
    blind_rotation_sigma: float = setting(
        0.01,
        unit="rad",
        limits=(0.0005, 0.5),
        reason="of the rotation between frames; parallax of near things biases it by some tenths of a degree",
    )


def evidence_floor(settings: EvidenceSettings) -> NDArray[np.float64]:
    """Covariance (6, 6) that is added to every registration: map, lens and strap err together."""
    return np.diag(np.repeat([settings.mount_rotation_sigma, settings.mount_translation_sigma], 3) ** 2)


class MountedCameras:
    """What registered cameras say about their segments, all of an instant at once.

    Args:
        body: whose mounts are used.
        settings: how far cameras are trusted.
    """

    def __init__(self, body: BodyModel, settings: EvidenceSettings) -> None:
        self._mounts = body.mounts
        self._floor = evidence_floor(settings)
        self._row = {camera: row for row, camera in enumerate(body.mounts)}
        segment_T_camera = np.array([mount.segment_T_camera for mount in body.mounts.values()]).reshape(-1, 4, 4)
        self._camera_T_segment = inverse(segment_T_camera)
        self._segment_xi_camera = adjoint(segment_T_camera)

    def absolute_evidence(self, matches: Iterable[LandmarkMatches]) -> dict[str, SegmentPose]:
        """Camera -> what it says of its segment, of those that the body carries and that are registered."""
        poses, covariances, rows = [], [], []
        for said in matches:
            if said.world_T_camera is not None and said.camera in self._row:
                poses.append(said.world_T_camera)
                covariances.append(said.pose_covariance)
                rows.append(self._row[said.camera])
        if not rows:
            return {}
        world_T_segment = np.array(poses) @ self._camera_T_segment[rows]
        Ad = self._segment_xi_camera[rows]
        on_segment = Ad @ (np.array(covariances) + self._floor) @ np.swapaxes(Ad, -1, -2)
        cameras = list(self._mounts)
        return {
            cameras[row]: SegmentPose(self._mounts[cameras[row]].segment, pose, covariance)
            for row, pose, covariance in zip(rows, world_T_segment, on_segment, strict=True)
        }


def poses_as_seen(body: BodyModel, path: NDArray[np.float64], evidence: Iterable[SegmentPose]) -> NDArray[np.float64]:
    """A path (S, 4, 4) with segments where the surest of their cameras has them."""
    poses = path.copy()
    surest: dict[int, float] = {}
    for seen in evidence:
        row, spread = body.segment_index[seen.segment], float(np.trace(seen.covariance))
        if spread < surest.get(row, np.inf):
            surest[row] = spread
            poses[row] = seen.world_T_segment
    return poses
