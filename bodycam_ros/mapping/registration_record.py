"""Where the cameras of a recording were registered, and by which of their images the map should grow."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.growth_settings import ExtensionSettings, GrowthSettings
from bodycam_ros.mapping.worn_keyframe import KeyframeChoice, has_moved
from bodycam_ros.registration.landmark_matches import LandmarkMatches


@dataclass(frozen=True)
class RegisteredImagePose:
    """Where a camera was when it took an image.

    Attributes:
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4).
        position_sigma: [m].
        turning: (3,) angular velocity, in camera axes [rad/s].
        readout_time: of the rows [s]; 0 where it was not known.
        coverage: share of the view in which landmarks were found.
        is_absolute: whether the landmarks that the map had before are enough to register it.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    position_sigma: float
    turning: NDArray[np.float64]
    readout_time: float
    coverage: float
    is_absolute: bool


class RegistrationRecord:
    """What became of all images of a recording in one or several rounds; of one image the best counts.

    Args:
        cameras: models by name.
        settings: of the growth.
        min_landmarks: that a registration takes.
    """

    def __init__(self, cameras: Mapping[str, CameraModel], settings: GrowthSettings, min_landmarks: int) -> None:
        self._settings = settings
        self._min_landmarks = min_landmarks
        self._views = {name: KeyframeChoice(model, settings) for name, model in cameras.items()}
        self._images: dict[str, set[int]] = {name: set() for name in cameras}
        self._registered: dict[str, dict[int, RegisteredImagePose]] = {name: {} for name in cameras}

    def add(self, matches: LandmarkMatches, stamp_ns: int, backwards: bool) -> None:
        """What became of an image.

        Args:
            matches: what the registrar says.
            stamp_ns: of the image [ns].
            backwards: whether the registrar's time was mirrored.
        """
        self._images[matches.camera].add(stamp_ns)
        if matches.world_T_camera is None:
            return
        direction = -1.0 if backwards else 1.0
        pose = RegisteredImagePose(
            stamp_ns=stamp_ns,
            world_T_camera=matches.world_T_camera,
            position_sigma=float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:]))),
            turning=direction * matches.turning,
            readout_time=direction * (matches.readout.in_use if matches.readout else 0.0),
            coverage=self._views[matches.camera].coverage(matches),
            is_absolute=len(matches.landmark_ids) - matches.grown >= self._min_landmarks,
        )
        known = self._registered[matches.camera].get(stamp_ns)
        if known is None or pose.position_sigma < known.position_sigma:
            self._registered[matches.camera][stamp_ns] = pose

    def share(self, camera: str) -> float:
        """Share of a camera's images that are registered, 0 to 1."""
        return len(self._registered[camera]) / max(1, len(self._images[camera]))

    @property
    def share_of_all(self) -> float:
        """Share of all images that are registered, 0 to 1."""
        images = sum(len(stamps) for stamps in self._images.values())
        return sum(len(poses) for poses in self._registered.values()) / max(1, images)

    @property
    def absolute_share(self) -> float:
        """Share of all images that the landmarks of the map as it was are enough for, 0 to 1."""
        images = sum(len(stamps) for stamps in self._images.values())
        return sum(p.is_absolute for poses in self._registered.values() for p in poses.values()) / max(1, images)

    def poses(self, camera: str) -> Iterable[RegisteredImagePose]:
        """The registered images of a camera, in order of time."""
        registered = self._registered[camera]
        return [registered[stamp_ns] for stamp_ns in sorted(registered)]

    def places(self, camera: str) -> NDArray[np.float64]:
        """(N, 3) where the registered images of a camera were taken [m]."""
        return np.array([pose.world_T_camera[:3, 3] for pose in self.poses(camera)]).reshape(-1, 3)

    def keyframes(self, settings: ExtensionSettings) -> dict[str, list[RegisteredImagePose]]:
        """Camera -> images from places and sides that differ, which show what the photographs do not."""
        chosen = {camera: self._spread(camera, settings.covered) for camera in self._registered}
        total = sum(map(len, chosen.values()))
        if total <= settings.keyframes:
            return chosen
        # Evenly fewer of every camera.
        return {
            camera: [poses[row] for row in _evenly(len(poses), settings.keyframes * len(poses) // total)]
            for camera, poses in chosen.items()
        }

    def _spread(self, camera: str, covered: float) -> list[RegisteredImagePose]:
        chosen: list[RegisteredImagePose] = []
        for pose in self.poses(camera):
            if pose.coverage >= covered or pose.position_sigma > self._settings.max_sigma:
                continue
            if chosen and not has_moved(chosen[-1].world_T_camera, pose.world_T_camera, self._settings):
                continue
            chosen.append(pose)
        return chosen


def _evenly(count: int, wanted: int) -> list[int]:
    return np.unique(np.linspace(0, count - 1, max(1, wanted)).round().astype(int)).tolist() if count else []
