"""Poses of segments by the registered cameras on them."""

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
    """Accuracy of body cameras."""

    mount_rotation_sigma: float = setting(
        0.0004,
        unit="rad",
        limits=(0.0, 0.1),
        reason="standard deviation added to the rotation of every registered camera, for errors of map, lens and "
        "strap; raise it to weigh cameras less",
    )
    mount_translation_sigma: float = setting(
        0.001,
        unit="m",
        limits=(0.0, 0.1),
        reason="standard deviation added to the position of every registered camera, for the same errors; raise it to "
        "weigh cameras less",
    )


def evidence_floor(settings: EvidenceSettings) -> NDArray[np.float64]:
    """Covariance (6, 6) that is added to every registration: map, lens and strap err together."""
    return np.diag(np.repeat([settings.mount_rotation_sigma, settings.mount_translation_sigma], 3) ** 2)


class MountedCameras:
    """Poses of segments by registered cameras, all of a frame at once.

    Args:
        body: whose mounts are used.
        settings: accuracy of cameras.
    """

    def __init__(self, body: BodyModel, settings: EvidenceSettings) -> None:
        self._mounts = body.mounts
        self._floor = evidence_floor(settings)
        self._row = {camera: row for row, camera in enumerate(body.mounts)}
        segment_T_camera = np.array([mount.segment_T_camera for mount in body.mounts.values()]).reshape(-1, 4, 4)
        self._camera_T_segment = inverse(segment_T_camera)
        self._segment_xi_camera = adjoint(segment_T_camera)

    def absolute_evidence(self, matches: Iterable[LandmarkMatches]) -> dict[str, SegmentPose]:
        """Camera -> measured pose of its segment, of registered cameras on the body."""
        registered = [m for m in matches if m.world_T_camera is not None and m.camera in self._row]
        if not registered:
            return {}
        rows = [self._row[each.camera] for each in registered]
        world_T_segment = np.array([each.world_T_camera for each in registered]) @ self._camera_T_segment[rows]
        Ad = self._segment_xi_camera[rows]
        covariances = np.array([each.pose_covariance for each in registered]) + self._floor
        on_segment = Ad @ covariances @ np.swapaxes(Ad, -1, -2)
        return {
            each.camera: SegmentPose(self._mounts[each.camera].segment, pose, covariance)
            for each, pose, covariance in zip(registered, world_T_segment, on_segment, strict=True)
        }
