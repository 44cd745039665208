"""Camera poses, points and observations from structure from motion, and the descriptors of the points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.triangulation import spread_directions

_DESCRIPTORS_PER_POINT = 4  # from directions far from each other: SIFT holds for some 30 degrees around each


@dataclass(frozen=True)
class Structure:
    """Cameras and points in one frame, "world", with the observations that tie them.

    Attributes:
        names: file names of the K registered photographs.
        cameras: that took them.
        camera_of_view: (K,) int64 row of the camera of each.
        world_T_camera: (K, 4, 4) their poses.
        points_world: (L, 3) points.
        colours: (L, 3) uint8 RGB.
        observation_views: (O,) int64 row of the photograph.
        observation_points: (O,) int64 row of the point.
        observation_pixels: (O, 2) float64, pixel centres at integers.
        observation_features: (O,) int64 row in the photograph's ``ImageFeatures``.
    """

    names: Sequence[str]
    cameras: tuple[CameraModel, ...]
    camera_of_view: NDArray[np.int64]
    world_T_camera: NDArray[np.float64]
    points_world: NDArray[np.float64]
    colours: NDArray[np.uint8]
    observation_views: NDArray[np.int64]
    observation_points: NDArray[np.int64]
    observation_pixels: NDArray[np.float64]
    observation_features: NDArray[np.int64]

    def transformed(self, scale: float, R: NDArray[np.float64], t: NDArray[np.float64]) -> "Structure":
        """The same structure after the similarity x -> scale R x + t of its frame."""
        world_T_camera = self.world_T_camera.copy()
        world_T_camera[:, :3, :3] = R @ self.world_T_camera[:, :3, :3]
        world_T_camera[:, :3, 3] = scale * self.world_T_camera[:, :3, 3] @ R.T + t
        return replace(self, world_T_camera=world_T_camera, points_world=scale * self.points_world @ R.T + t)

    def observed_points_camera(self) -> NDArray[np.float64]:
        """The observed point (O, 3) of each observation, in the axes of its camera."""
        poses = self.world_T_camera[self.observation_views]
        offsets = self.points_world[self.observation_points] - poses[:, :3, 3]
        points: NDArray[np.float64] = np.einsum("nij,ni->nj", poses[:, :3, :3], offsets)
        return points

    def with_points(self, kept: NDArray[np.bool_]) -> "Structure":
        """The same structure with only the points that ``kept`` (L,) marks, and the observations of them."""
        observed = kept[self.observation_points]
        return replace(
            self,
            points_world=self.points_world[kept],
            colours=self.colours[kept],
            observation_views=self.observation_views[observed],
            observation_points=(np.cumsum(kept) - 1)[self.observation_points[observed]],
            observation_pixels=self.observation_pixels[observed],
            observation_features=self.observation_features[observed],
        )

    def views_per_point(self) -> NDArray[np.int64]:
        """Number (L,) of observations of each point."""
        return np.bincount(self.observation_points, minlength=len(self.points_world))

    def reprojection_errors(self) -> NDArray[np.float64]:
        """Distance (O,) [px] from where a point projects to where it was observed; infinite outside the lens."""
        points_camera = self.observed_points_camera()
        errors = np.full(len(points_camera), np.inf)
        for camera, rows in self.observations_by_camera():
            projected, valid = camera.project(points_camera[rows])
            errors[rows[valid]] = np.linalg.norm(projected - self.observation_pixels[rows], axis=1)[valid]
        return errors

    def observations_by_camera(self) -> Iterator[tuple[CameraModel, NDArray[np.int64]]]:
        """Each camera with the rows of its observations."""
        camera_of_observation = self.camera_of_view[self.observation_views]
        for row, camera in enumerate(self.cameras):
            yield camera, np.flatnonzero(camera_of_observation == row)


def distinct(taken_by: Sequence[CameraModel]) -> tuple[tuple[CameraModel, ...], NDArray[np.int64]]:
    """The different cameras of K photographs in the order of their first use, and the row of each one's (K,)."""
    different = {id(camera): camera for camera in taken_by}
    row_of = {key: row for row, key in enumerate(different)}
    return tuple(different.values()), np.array([row_of[id(camera)] for camera in taken_by], np.int64)


def choose_descriptors(structure: Structure, features: Sequence[ImageFeatures]) -> dict[str, Any]:
    """Choose each landmark's descriptors so that they spread over the directions that it was observed from.

    Args:
        structure: in the frame of the map.
        features: of the photographs of ``structure``, in its order.

    Returns:
        The attributes of a ``ReferenceMap`` that describe its landmarks.
    """
    points_camera = structure.observed_points_camera()
    distances = np.linalg.norm(points_camera, axis=1)
    to_camera = structure.world_T_camera[structure.observation_views, :3, 3]
    to_camera = (to_camera - structure.points_world[structure.observation_points]) / distances[:, None]

    # By landmark, and within it the nearest view first: it has the sharpest and largest image.
    order = np.lexsort((distances, structure.observation_points))
    landmarks = structure.observation_points[order]
    starts = np.flatnonzero(np.diff(landmarks, prepend=-1))
    kept = [
        group[spread_directions(to_camera[group], _DESCRIPTORS_PER_POINT)]
        for group in np.split(order, starts[1:])
        if len(group)
    ]
    chosen = np.concatenate(kept) if kept else np.zeros(0, dtype=np.int64)

    views, rows = structure.observation_views[chosen], structure.observation_features[chosen]
    descriptors = np.zeros((len(chosen), 128), dtype=np.uint8)
    sigmas = np.zeros(len(chosen))
    for view, image in enumerate(features):
        here = views == view
        descriptors[here] = image.descriptors[rows[here]]
        sigmas[here] = image.sigmas[rows[here]]
    sizes = sigmas * distances[chosen] / _local_scales(structure, points_camera)[chosen]
    return {
        "descriptor_landmark": structure.observation_points[chosen].astype(np.uint32),
        "descriptors": descriptors,
        "descriptor_view": to_camera[chosen].astype(np.float32),
        "descriptor_size": sizes.astype(np.float32),
    }


def _local_scales(structure: Structure, points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
    """(O,) pixels per radian at each observation."""
    cosines = points_camera[:, 2] / np.linalg.norm(points_camera, axis=1)
    scales = np.empty(len(points_camera))
    for camera, rows in structure.observations_by_camera():
        scales[rows] = scales_at(camera, cosines[rows])
    return scales
