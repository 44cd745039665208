"""The evidence of images on cameras and landmarks, as quadratic forms around wherever the body puts the cameras."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.camera import CameraModel
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings, evidence_floor
from bodycam_ros.geometry import adjoint, inverse
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.pose_kernels import linearise_images

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CameraViews:
    """What one camera saw of the landmarks, in order of time.

    Attributes:
        camera: its model.
        frames: (N) row of the frame.
        landmarks: (N) row of the landmark.
        pixels: (N, 2) where the image shows it.
        track_share: (N) one over the number of images in which the same track shows the landmark.
    """

    camera: CameraModel
    frames: NDArray[np.intp]
    landmarks: NDArray[np.intp]
    pixels: Array
    track_share: Array


@dataclass(frozen=True, eq=False)
class ImageEvidence:
    """Landmarks in images.

    Attributes:
        views: (C) of the cameras.
        points_world: (L, 3) where the landmarks are taken to be [m].
        map_points_world: (L, 3) where the map has them [m].
        frame_T_image: (T, C, 4, 4) see ``CameraMotion``.
        pose_fit, evidence: noise of the landmarks and floor of a camera, those of the solver.
    """

    views: Sequence[CameraViews]
    points_world: Array
    map_points_world: Array
    frame_T_image: Array
    pose_fit: PoseFitSettings
    evidence: EvidenceSettings

    def linearised(self, world_T_camera: Array) -> tuple[Array, Array]:
        """Hessians (T, C, 6, 6) and gradients (T, C, 6) of half the robust squared reprojection errors (A eq. 8).

        A camera's landmarks first give the step to their own optimum and its covariance; the floor is added to that
        covariance, so that a camera with a thousand landmarks is not weighted as if known to micrometres.
        """
        hessians = np.zeros((*world_T_camera.shape[:2], 6, 6))
        gradients = np.zeros((*world_T_camera.shape[:2], 6))
        for c, view in enumerate(self.views):
            starts = np.flatnonzero(np.diff(view.frames, prepend=-1))
            seen = view.frames[starts]
            hessians[seen, c], gradients[seen, c] = linearise_images(
                view.camera.parameters,
                self.points_world[view.landmarks],
                view.pixels,
                np.append(starts, len(view.frames)),
                world_T_camera[seen, c] @ self.frame_T_image[seen, c],
                self.pose_fit.inlier_px,
            )
        image_xi_frame = adjoint(inverse(self.frame_T_image))
        frame_xi_image = np.swapaxes(image_xi_frame, -1, -2)
        hessians = frame_xi_image @ hessians @ image_xi_frame / self.pose_fit.pixel_sigma**2
        gradients = (frame_xi_image @ gradients[..., None]) / self.pose_fit.pixel_sigma**2
        # (H^-1 + F)^-1 = (1 + H F)^-1 H needs no inverse of H.
        floored = np.linalg.solve(
            np.eye(6) + hessians @ evidence_floor(self.evidence), np.concatenate([hessians, gradients], axis=-1)
        )
        return 0.5 * (floored[..., :6] + np.swapaxes(floored[..., :6], -1, -2)), floored[..., 6]

    def with_landmarks_refined(self, world_T_camera: Array, landmark_sigma: float) -> "ImageEvidence":
        """The same images, with each landmark where the cameras see it, held by where the map has it.

        The images of one track share its error, so that together they count as one measurement.

        Args:
            world_T_camera: (T, C, 4, 4) poses, which are held.
            landmark_sigma: sigma of a landmark of the map [m].
        """
        hessians = np.tile(np.eye(3) / landmark_sigma**2, (len(self.points_world), 1, 1))
        gradients = (self.points_world - self.map_points_world) / landmark_sigma**2
        for c, view in enumerate(self.views):
            world_T_image = (world_T_camera[:, c] @ self.frame_T_image[:, c])[view.frames]
            residuals, by_point, weights = self._seen(view, world_T_image)
            J = by_point @ np.swapaxes(world_T_image[:, :3, :3], 1, 2)
            WJ = np.swapaxes((weights * view.track_share / self.pose_fit.pixel_sigma**2)[:, None, None] * J, 1, 2)
            np.add.at(hessians, view.landmarks, WJ @ J)
            np.add.at(gradients, view.landmarks, (WJ @ residuals[..., None])[..., 0])
        steps = np.linalg.solve(hessians, gradients[..., None])[..., 0]
        return replace(self, points_world=self.points_world - steps)

    def _seen(self, view: CameraViews, world_T_image: Array) -> tuple[Array, Array, Array]:
        """Reprojection errors (N, 2) [px], their derivatives (N, 2, 3) by the point in the camera, and weights (N)."""
        offsets = self.points_world[view.landmarks] - world_T_image[:, :3, 3]
        points_camera = (offsets[:, None, :] @ world_T_image[:, :3, :3])[:, 0]
        projected, by_point, visible = view.camera.project_with_jacobian(points_camera)
        residuals = np.where(visible[:, None], projected - view.pixels, 0.0)
        # Geman-McClure, as in the registrar's fit.
        weights = visible / (1.0 + (residuals**2).sum(axis=1) / self.pose_fit.inlier_px**2) ** 2
        return residuals, np.where(visible[:, None, None], by_point, 0.0), weights


def image_evidence(
    motion: CameraMotion,
    rows: NDArray[np.intp],
    models: Mapping[str, CameraModel],
    pose_fit: PoseFitSettings,
    evidence: EvidenceSettings,
) -> ImageEvidence:
    """The landmarks that the images of some frames show."""
    ids: list[NDArray[np.uint32]] = []
    points: list[NDArray[np.float32]] = []
    for row in rows:
        for matches in motion.matches[row].values():
            ids.append(matches.landmark_ids)
            points.append(matches.points_world)
    landmark_ids, first = np.unique(np.concatenate(ids), return_index=True)
    map_points_world = np.concatenate(points)[first].astype(np.float64)
    views = []
    for camera in motion.cameras:
        seen = [(i, motion.matches[row][camera]) for i, row in enumerate(rows) if camera in motion.matches[row]]
        tracks, track_of = np.unique(
            np.concatenate([m.track_ids for _, m in seen] or [np.zeros(0, np.uint32)]), return_inverse=True
        )
        views.append(
            CameraViews(
                camera=models[camera],
                frames=np.concatenate([np.full(len(m.pixels), i) for i, m in seen] or [np.zeros(0, int)]),
                landmarks=np.concatenate(
                    [np.searchsorted(landmark_ids, m.landmark_ids) for _, m in seen] or [np.zeros(0, int)]
                ),
                pixels=np.concatenate([m.pixels for _, m in seen] or [np.zeros((0, 2))]).astype(np.float64),
                track_share=1.0 / np.bincount(track_of, minlength=len(tracks))[track_of],
            )
        )
    return ImageEvidence(views, map_points_world, map_points_world, motion.frame_T_image[rows], pose_fit, evidence)
