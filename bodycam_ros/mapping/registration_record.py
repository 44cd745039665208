"""Poses of all registered images of a recording, and the choice of those that extend the map."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.body_keyframe import KeyframeSelection, has_moved
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_MAX_COVERED = 0.8  # share of the view with landmarks of the photographs, from which on an image adds none
_MAX_SIGMA_M = 0.02  # of a keyframe's position
_MAX_KEYFRAMES = 300  # of all cameras: each costs 30 kB in the map and a tenth of a second in a round


@dataclass(frozen=True)
class ExtensionRound:
    """One round.

    Attributes:
        shares: camera -> share of its images that are registered, in this round or before, 0 to 1.
        share: the same of all images.
        absolute: share of all images with enough landmarks of the photographs to be registered by these alone.
    """

    shares: Mapping[str, float]
    share: float
    absolute: float


@dataclass(frozen=True)
class RegisteredImagePose:
    """The pose of a camera at an image.

    Attributes:
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4).
        position_sigma: [m].
        turning: (3,) angular velocity, in camera axes [rad/s].
        readout_time: of the rows [s]; 0 if unknown.
        coverage: share of the view in which landmarks were found.
        is_absolute: whether landmarks of the photographs alone are enough to register it.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    position_sigma: float
    turning: NDArray[np.float64]
    readout_time: float
    coverage: float
    is_absolute: bool


class RegistrationRecord:
    """All images of a recording in one or several rounds; of an image's registrations the most certain counts.

    Args:
        cameras: models by name.
        min_landmarks: that a registration takes.
    """

    def __init__(self, cameras: Mapping[str, CameraModel], min_landmarks: int) -> None:
        self._min_landmarks = min_landmarks
        self._views = {name: KeyframeSelection(model) for name, model in cameras.items()}
        self._images: dict[str, set[int]] = {name: set() for name in cameras}
        self._registered: dict[str, dict[int, RegisteredImagePose]] = {name: {} for name in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Add the registration of an image."""
        stamp_ns, registered = matches.stamp_ns, self._registered[matches.camera]
        self._images[matches.camera].add(stamp_ns)
        if matches.world_T_camera is None:
            return
        position_sigma = float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))
        if stamp_ns not in registered or position_sigma < registered[stamp_ns].position_sigma:
            registered[stamp_ns] = RegisteredImagePose(
                stamp_ns=stamp_ns,
                world_T_camera=matches.world_T_camera,
                position_sigma=position_sigma,
                turning=matches.turning,
                readout_time=matches.readout.in_use if matches.readout else 0.0,
                coverage=self._views[matches.camera].coverage(matches),
                is_absolute=len(matches.landmark_ids) - matches.grown >= self._min_landmarks,
            )

    def summary(self) -> ExtensionRound:
        """Shares of the images that are registered by now."""
        images = max(1, sum(map(len, self._images.values())))
        poses = {camera: self._in_order(camera) for camera in self._registered}
        everywhere = [pose for of_camera in poses.values() for pose in of_camera]
        return ExtensionRound(
            shares={camera: len(found) / max(1, len(self._images[camera])) for camera, found in poses.items()},
            share=len(everywhere) / images,
            absolute=sum(pose.is_absolute for pose in everywhere) / images,
        )

    def choose_keyframes(self) -> dict[str, list[RegisteredImagePose]]:
        """Camera -> images from places and directions that differ, which show what the photographs do not."""
        chosen = {camera: self._spread(camera) for camera in self._registered}
        total = sum(map(len, chosen.values()))
        if total <= _MAX_KEYFRAMES:
            return chosen
        # Evenly fewer of every camera.
        return {camera: _evenly(poses, _MAX_KEYFRAMES * len(poses) // total) for camera, poses in chosen.items()}

    def _in_order(self, camera: str) -> list[RegisteredImagePose]:
        return [pose for _, pose in sorted(self._registered[camera].items())]

    def _spread(self, camera: str) -> list[RegisteredImagePose]:
        chosen: list[RegisteredImagePose] = []
        for pose in self._in_order(camera):
            if pose.coverage >= _MAX_COVERED or pose.position_sigma > _MAX_SIGMA_M:
                continue
            if not chosen or has_moved(chosen[-1].world_T_camera, pose.world_T_camera):
                chosen.append(pose)
        return chosen


def _evenly(poses: list[RegisteredImagePose], wanted: int) -> list[RegisteredImagePose]:
    rows = np.linspace(0, len(poses) - 1, min(len(poses), max(1, wanted)))
    return [poses[row] for row in np.unique(rows.round().astype(int)).tolist()]
