"""Which images of a recording are registered in the rounds of map extension, and which of them extend the map."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
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
        self._images: dict[tuple[str, int], _Registered | None] = {}

    def add(self, matches: LandmarkMatches) -> None:
        """Add the registration of an image."""
        before = self._images.setdefault((matches.camera, matches.stamp_ns), None)
        if matches.world_T_camera is None or (before and before.matches.position_sigma <= matches.position_sigma):
            return
        is_absolute = len(matches.landmark_ids) - matches.grown >= self._min_landmarks
        coverage = self._views[matches.camera].coverage(matches)
        self._images[matches.camera, matches.stamp_ns] = _Registered(matches.bare(), coverage, is_absolute)

    def summary(self) -> ExtensionRound:
        """Shares of the images that are registered by now."""
        images, found = Counter(camera for camera, _ in self._images), [each for each in self._images.values() if each]
        registered = Counter(each.matches.camera for each in found)
        return ExtensionRound(
            shares={camera: registered[camera] / max(1, images[camera]) for camera in self._views},
            share=len(found) / max(1, len(self._images)),
            absolute=sum(each.is_absolute for each in found) / max(1, len(self._images)),
        )

    def choose_keyframes(self) -> dict[tuple[str, int], LandmarkMatches]:
        """Camera and stamp [ns] -> images from places and directions that differ, which show what photographs do not.

        They are registered, and without their landmarks.
        """
        chosen: dict[str, list[LandmarkMatches]] = {camera: [] for camera in self._views}
        for (camera, _), each in sorted(self._images.items(), key=lambda item: item[0]):
            if each is None or each.coverage >= _MAX_COVERED or each.matches.position_sigma > MAX_SIGMA_M:
                continue
            pose, latest = each.matches.world_T_camera, chosen[camera][-1].world_T_camera if chosen[camera] else None
            if pose is not None and (latest is None or has_moved(latest, pose)):
                chosen[camera].append(each.matches)
        total = max(_MAX_KEYFRAMES, sum(map(len, chosen.values())))  # beyond it evenly fewer of every camera
        return {
            (each.camera, each.stamp_ns): each
            for of_camera in chosen.values()
            for each in _evenly(of_camera, _MAX_KEYFRAMES * len(of_camera) // total)
        }


def _evenly(images: list[LandmarkMatches], wanted: int) -> list[LandmarkMatches]:
    rows = np.linspace(0, len(images) - 1, min(len(images), max(1, wanted)))
    return [images[row] for row in np.unique(rows.round().astype(int)).tolist()]
