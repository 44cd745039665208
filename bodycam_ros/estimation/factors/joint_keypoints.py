"""Keypoints of joints in images of static cameras: where each joint's centre projects, minus its keypoint."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.geometry import Array, inverse, transform_points

KERNEL = 4.0  # sigmas from which on a keypoint counts less (Cauchy): a detector's errors have long tails
_OUT_OF_VIEW = 20.0  # error in sigmas of a joint outside the lens's cone; it has no derivative


@dataclass(frozen=True, eq=False)
class JointKeypoints:
    """N keypoints of one state; a joint's centre is the origin of its outer segment.

    Attributes:
        views: camera -> lens and world_T_camera (4, 4).
        cameras: (N,) rows of ``views``.
        segments: (N,) rows of the segments whose origins were detected.
        pixels: (N, 2) where [px].
        sigmas: (N,) of each, along u and along v [px].
    """

    views: Mapping[str, tuple[CameraModel, Array]]
    cameras: NDArray[np.int64]
    segments: NDArray[np.int64]
    pixels: Array
    sigmas: Array

    @staticmethod
    def nothing() -> "JointKeypoints":
        """No keypoint."""
        rows = np.zeros(0, np.int64)
        return JointKeypoints({}, rows, rows, np.zeros((0, 2)), np.zeros(0))

    def __len__(self) -> int:
        return len(self.segments)

    def __getitem__(self, rows: NDArray[Any]) -> "JointKeypoints":
        """Some of the keypoints, by number or mask."""
        return JointKeypoints(self.views, self.cameras[rows], self.segments[rows], self.pixels[rows], self.sigmas[rows])

    @property
    def rows(self) -> int:
        """See ``StateFactor``."""
        return 2 * len(self)

    def error(self, at: Coordinates) -> Array:
        """See ``StateFactor``."""
        errors, _ = self._residuals(at.poses)
        squared = (errors**2).sum(axis=1) / KERNEL**2
        shrunk = np.sqrt(np.log1p(squared) / np.where(squared > 0.0, squared, 1.0))
        return np.asarray((errors * np.where(squared > 0.0, shrunk, 1.0)[:, None]).ravel())

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """See ``StateFactor``."""
        errors, by_origin = self._weighted(at.poses)
        by_step = by_origin @ at.jacobians[self.segments, 3:]
        return errors.ravel(), by_step.reshape(self.rows, -1)

    def equations(self, poses: Array) -> tuple[Array, Array]:
        """Robust normal equations (S, 6, 6), (S, 6) of each segment by itself, at poses (S, 4, 4).

        They are for a change of world_T_segment in the segments' axes, rotation first; right sides point downhill.
        """
        matrix, right = np.zeros((len(poses), 6, 6)), np.zeros((len(poses), 6))
        errors, by_origin = self._weighted(poses)
        np.add.at(matrix[:, 3:, 3:], self.segments, np.swapaxes(by_origin, 1, 2) @ by_origin)
        np.add.at(right[:, 3:], self.segments, -np.einsum("nij,ni->nj", by_origin, errors))
        return matrix, right

    def late(self, poses: Array, velocities: Array, late_s: Array) -> "JointKeypoints":
        """The keypoints as they were ``late_s`` (N,) before their images, on segments with velocities (S, 6)."""
        _, by_origin = self._residuals(poses)
        moved = np.einsum("nij,nj->ni", by_origin, velocities[self.segments, 3:]) * self.sigmas[:, None]
        return JointKeypoints(
            self.views, self.cameras, self.segments, self.pixels - moved * late_s[:, None], self.sigmas
        )

    @cached_property
    def _by_view(self) -> list[NDArray[np.int64]]:
        return [np.flatnonzero(self.cameras == view) for view in range(len(self.views))]

    def _weighted(self, poses: Array) -> tuple[Array, Array]:
        """Residuals and derivatives by the square root of Cauchy's weight (Black and Rangarajan 1996)."""
        errors, by_origin = self._residuals(poses)
        weights = (1.0 + (errors**2).sum(axis=1) / KERNEL**2) ** -0.5
        return errors * weights[:, None], by_origin * weights[:, None, None]

    def _residuals(self, poses: Array) -> tuple[Array, Array]:
        """Residuals (N, 2) in sigmas and derivatives (N, 2, 3) by the origins [1/m], in the segments' axes."""
        errors, by_origin = np.zeros((len(self), 2)), np.zeros((len(self), 2, 3))
        for (camera, world_T_camera), rows in zip(self.views.values(), self._by_view, strict=True):
            if not len(rows):
                continue
            at = poses[self.segments[rows]]
            points = transform_points(inverse(world_T_camera), at[:, :3, 3])
            seen, by_point, valid = camera.project_with_jacobian(points)
            off = (seen - self.pixels[rows]) / self.sigmas[rows, None]
            errors[rows] = np.where(valid[:, None], off, _OUT_OF_VIEW)
            turned = by_point @ (world_T_camera[:3, :3].T @ at[:, :3, :3]) / self.sigmas[rows, None, None]
            by_origin[rows] = np.where(valid[:, None, None], turned, 0.0)
        return errors, by_origin
