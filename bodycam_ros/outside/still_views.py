"""What several images of a camera show of the map, and whether it stood still meanwhile."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, log_se3, transform_points
from bodycam_ros.registration.pose_fit import PoseFit

LEAST_IMAGES = 2
"""Fewer cannot tell whether the camera moves, nor what in an image does."""

_FEW = 0.5
"""An image that shows less than this share of the usual landmarks is dark, or somebody stands before it."""

_SURE = 60
"""Landmarks by which an image is registered right, however many others show: those that were wrong by more than 50 mm,
of 81 with half to three quarters of the picture covered, had 22, 32 and 56."""


@dataclass(frozen=True, eq=False)
class View:
    """What one image shows.

    Attributes:
        camera: that took it.
        rows: (N,) of landmarks in the map.
        points_world: (N, 3) where the map has them [m].
        pixels: (N, 2) where the image has them.
        fit: the pose by them alone.
    """

    camera: CameraModel
    rows: NDArray[np.int64]
    points_world: Array
    pixels: Array
    fit: PoseFit

    @property
    def count(self) -> int:
        """Landmarks that agree."""
        return int(self.fit.inliers.sum())

    def apart(self, world_T_camera: Array) -> Array:
        """(6,) from a pose to that of the image, rotation [rad] then translation [m]."""
        return log_se3(inverse(world_T_camera) @ self.fit.world_T_camera)

    def is_at(self, world_T_camera: Array, sigmas: float, tolerance_px: float) -> bool:
        """Whether the image may have been taken from a pose (4, 4), or from so near that it hardly matters.

        Args:
            world_T_camera: the pose.
            sigmas: standard deviations of the image's own by which that may differ.
            tolerance_px: median shift of the landmarks between the two that hardly matters.
        """
        xi = self.apart(world_T_camera)
        if xi @ self.fit.information @ xi <= sigmas**2:
            return True
        points_world = self.points_world[self.fit.inliers]
        here, there = (
            self.camera.project(transform_points(inverse(pose), points_world))[0]
            for pose in (self.fit.world_T_camera, world_T_camera)
        )
        # A landmark that is out of view from there is NaN, and so is the median: no answer is no.
        return bool(np.median(np.linalg.norm(there - here, axis=1)) <= tolerance_px)


Views = Mapping[int, View]
"""Number of an image -> what it shows."""


def seen_together(views: Views) -> tuple[NDArray[np.int64], Array]:
    """Rows (N,) of the landmarks that several views have, and where their medians have them (N, 2).

    A landmark counts once: what is wrong with it, or with the photograph that shows it, is wrong in all images alike.
    """
    rows = np.concatenate([view.rows for view in views.values()])
    pixels = np.concatenate([view.pixels for view in views.values()])
    order = np.argsort(rows, kind="stable")
    named, first, count = np.unique(rows[order], return_index=True, return_counts=True)
    several = np.flatnonzero(count >= LEAST_IMAGES)
    medians = [np.median(pixels[order[first[at] : first[at] + count[at]]], axis=0) for at in several]
    return named[several], np.array(medians, np.float64).reshape(-1, 2)


def taken_elsewhere(
    alone: Views, looked_for: Views, world_T_camera: Array, sigmas: float, tolerance_px: float
) -> Views:
    """The images that show that the camera was elsewhere than at a pose, by what they show.

    An image that shows little of the place may be registered wrong by metres. So it is asked first for what should be
    seen from the pose, and for its own registration only if it does not show that.

    Args:
        alone: what they show, each registered by itself.
        looked_for: the same, by landmarks that were looked for from the pose; empty where that cannot be done.
        world_T_camera: (4, 4) the pose.
        sigmas, tolerance_px: see ``View.is_at``.
    """
    elsewhere = {}
    for number in {*alone, *looked_for}:
        if _tells(looked_for, number):
            telling = looked_for[number]
        elif _tells(alone, number) or (number in alone and alone[number].count >= _SURE):
            telling = alone[number]
        else:
            continue
        if not telling.is_at(world_T_camera, sigmas, tolerance_px):
            elsewhere[number] = telling
    return elsewhere


def _tells(views: Views, number: int) -> bool:
    """Whether an image shows about as much as the others."""
    return number in views and views[number].count >= _FEW * np.median([view.count for view in views.values()])
