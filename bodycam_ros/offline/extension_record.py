"""Which images of a recording are registered in the rounds of map extension, and which of them extend the map."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.body_keyframe import MAX_SIGMA_M, KeyframeSelection, has_moved
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_MAX_COVERED = 0.8  # share of the view with landmarks of the photographs, from which on an image adds none
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
class _Registered:
    """A registration without its landmarks, the share of the view with these, and whether photographs' are enough."""

    matches: LandmarkMatches
    coverage: float
    is_absolute: bool


class ExtensionRecord:
    """All images of a recording in one or several rounds; of an image's registrations the most certain counts.

    Args:
        cameras: models by name.
        min_landmarks: that a registration takes.
    """

    def __init__(self, cameras: Mapping[str, CameraModel], min_landmarks: int) -> None:
        self._min_landmarks = min_landmarks
        self._views = {name: KeyframeSelection(model) for name, model in cameras.items()}
        self._images: dict[str, dict[int, _Registered | None]] = {name: {} for name in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Add the registration of an image."""
        images, camera = self._images[matches.camera], matches.camera
        before = images.setdefault(matches.stamp_ns, None)
        if matches.world_T_camera is None or (before and before.matches.position_sigma <= matches.position_sigma):
            return
        is_absolute = len(matches.landmark_ids) - matches.grown >= self._min_landmarks
        images[matches.stamp_ns] = _Registered(matches.bare(), self._views[camera].coverage(matches), is_absolute)

    def summary(self) -> ExtensionRound:
        """Shares of the images that are registered by now."""
        found = {camera: self._in_order(camera) for camera in self._images}
        everywhere = [each for of_camera in found.values() for each in of_camera]
        count = max(1, sum(map(len, self._images.values())))
        return ExtensionRound(
            shares={camera: len(each) / max(1, len(self._images[camera])) for camera, each in found.items()},
            share=len(everywhere) / count,
            absolute=sum(each.is_absolute for each in everywhere) / count,
        )

    def choose_keyframes(self) -> dict[tuple[str, int], LandmarkMatches]:
        """Camera and stamp [ns] -> images from places and directions that differ, which show what photographs do not.

        They are registered, and without their landmarks.
        """
        chosen = {camera: self._spread(camera) for camera in self._images}
        total = max(_MAX_KEYFRAMES, sum(map(len, chosen.values())))  # beyond it evenly fewer of every camera
        return {
            (each.camera, each.stamp_ns): each
            for of_camera in chosen.values()
            for each in _evenly(of_camera, _MAX_KEYFRAMES * len(of_camera) // total)
        }

    def _in_order(self, camera: str) -> list[_Registered]:
        return [each for _, each in sorted(self._images[camera].items()) if each is not None]

    def _spread(self, camera: str) -> list[LandmarkMatches]:
        chosen: list[LandmarkMatches] = []
        latest: Array | None = None
        for each in self._in_order(camera):
            pose = each.matches.world_T_camera
            if pose is None or each.coverage >= _MAX_COVERED or each.matches.position_sigma > MAX_SIGMA_M:
                continue
            if latest is None or has_moved(latest, pose):
                chosen.append(each.matches)
                latest = pose
        return chosen


def _evenly(images: list[LandmarkMatches], wanted: int) -> list[LandmarkMatches]:
    rows = np.linspace(0, len(images) - 1, min(len(images), max(1, wanted)))
    return [images[row] for row in np.unique(rows.round().astype(int)).tolist()]
