"""What one camera says about the segment that carries it, as a pose with its information (DESIGN 4.2).

A registered camera gives an absolute pose (A eq. 8, first term). A camera that sees too few landmarks to be
registered alone still gives what they say, linearised at the body's prediction. A blind one gives its rotation
since the frame before (A eq. 2 and the second term of eq. 8).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import adjoint, inverse, log_se3, rigid
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose
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
    min_weak_landmarks: int = setting(
        6, limits=(3, 50), reason="an unregistered camera with fewer landmarks in agreement says nothing"
    )
    min_weak_share: float = setting(
        0.7,
        limits=(0.0, 1.0),
        reason="share of its landmarks that must agree; of wrong ones some always agree by chance",
    )
    max_weak_turn: float = setting(
        0.2, unit="rad", limits=(0.0, 3.2), reason="how far its rotation may be from the body's prediction"
    )
    max_weak_shift: float = setting(
        0.15, unit="m", limits=(0.0, 5.0), reason="how far its position may be from the body's prediction"
    )


def evidence_floor(settings: EvidenceSettings) -> NDArray[np.float64]:
    """Covariance (6, 6) that is added to every registration: map, lens and strap err together."""
    return np.diag(np.repeat([settings.mount_rotation_sigma, settings.mount_translation_sigma], 3) ** 2)


@dataclass(frozen=True)
class SegmentPose:
    """An absolute measurement of a segment: world_T_segment (4, 4) and its covariance (6, 6) in segment axes."""

    segment: str
    world_T_segment: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True)
class SegmentTurn:
    """A measurement of a segment's rotation since the frame before: previous_R_segment (3, 3) and its sigma [rad]."""

    segment: str
    previous_R_segment: NDArray[np.float64]
    sigma: float


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


def weak_evidence(
    matches: LandmarkMatches,
    camera: CameraModel,
    mount: CameraMount,
    predicted_world_T_segment: NDArray[np.float64],
    pose_fit: PoseFitSettings,
    settings: EvidenceSettings,
) -> SegmentPose | None:
    """What the few landmarks of an unregistered camera say, fitted from where the body should be.

    A handful of wrong matches agree on some pose or other: most of them must agree, and not far from the prediction.
    """
    if len(matches.track_ids) < settings.min_weak_landmarks:
        return None
    start = predicted_world_T_segment @ mount.segment_T_camera
    fit = fit_pose(camera, matches.points_world, matches.pixels, start, pose_fit)
    needed = max(settings.min_weak_landmarks, settings.min_weak_share * len(matches.track_ids))
    moved = log_se3(inverse(start) @ fit.world_T_camera)
    near = np.linalg.norm(moved[:3]) < settings.max_weak_turn and np.linalg.norm(moved[3:]) < settings.max_weak_shift
    if fit.inliers.sum() < needed or not near:
        return None
    # Directions that the few landmarks leave open must stay open: a vague prior makes the information invertible.
    vague = np.diag(np.repeat([1.0, 1.0], 3))
    return _on_segment(mount, fit.world_T_camera, np.asarray(np.linalg.inv(fit.information + vague)), settings)


def rotation_evidence(matches: LandmarkMatches, mount: CameraMount, settings: EvidenceSettings) -> SegmentTurn | None:
    """How a camera's segment turned since the frame before, or None if its tracks do not tell."""
    if matches.rotation_inliers == 0:
        return None
    segment_R_camera = mount.segment_T_camera[:3, :3]
    previous_R_segment = segment_R_camera @ matches.current_R_previous.T @ segment_R_camera.T
    return SegmentTurn(mount.segment, previous_R_segment, settings.blind_rotation_sigma)


def _on_segment(
    mount: CameraMount, world_T_camera: NDArray[np.float64], covariance: NDArray[np.float64], settings: EvidenceSettings
) -> SegmentPose:
    # A change of the camera's pose, seen in the segment's axes.
    segment_xi_camera = adjoint(mount.segment_T_camera)
    return SegmentPose(
        mount.segment,
        world_T_camera @ inverse(mount.segment_T_camera),
        segment_xi_camera @ (covariance + evidence_floor(settings)) @ segment_xi_camera.T,
    )


def turned(
    world_T_segment_before: NDArray[np.float64], turn: SegmentTurn, predicted: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The predicted pose (4, 4) with its rotation replaced by the measured one."""
    return rigid(world_T_segment_before[:3, :3] @ turn.previous_R_segment, predicted[:3, 3])


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
