"""What structure from motion recovers: camera poses, points and who sees what; and that as a PLY file."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel

NO_FEATURE = -1

_CAMERA_COLOUR = (255, 0, 0)
_AXIS_POINTS = 10  # per camera, along its optical axis
_AXIS_LENGTH = 0.02  # of the extent of all cameras


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
        observation_features: (O,) int64 row in the photograph's ``ImageFeatures``; ``NO_FEATURE`` if there is none.
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
        """The observed point (O, 3) of each observation, in the axes of the camera that sees it."""
        poses = self.world_T_camera[self.observation_views]
        offsets = self.points_world[self.observation_points] - poses[:, :3, 3]
        points: NDArray[np.float64] = np.einsum("nij,ni->nj", poses[:, :3, :3], offsets)
        return points

    def with_points(self, kept: NDArray[np.bool_]) -> "Structure":
        """The same structure with only the points that ``kept`` (L,) marks, and the observations of them."""
        new_rows = np.cumsum(kept) - 1
        seen = self.with_observations(kept[self.observation_points])
        return replace(
            seen,
            points_world=self.points_world[kept],
            colours=self.colours[kept],
            observation_points=new_rows[seen.observation_points],
        )

    def with_observations(self, kept: NDArray[np.bool_]) -> "Structure":
        """The same structure with only the observations that ``kept`` (O,) marks; points may be left with none."""
        return replace(
            self,
            observation_views=self.observation_views[kept],
            observation_points=self.observation_points[kept],
            observation_pixels=self.observation_pixels[kept],
            observation_features=self.observation_features[kept],
        )

    def views_per_point(self) -> NDArray[np.int64]:
        """Number (L,) of observations of each point."""
        return np.bincount(self.observation_points, minlength=len(self.points_world))

    def reprojection_errors(self) -> NDArray[np.float64]:
        """Distance (O,) [px] from where a point projects to where it was seen; infinite outside the lens."""
        points_camera = self.observed_points_camera()
        errors = np.full(len(points_camera), np.inf)
        for camera, seen in self.observations_by_camera():
            projected, valid = camera.project(points_camera[seen])
            errors[seen[valid]] = np.linalg.norm(projected - self.observation_pixels[seen], axis=1)[valid]
        return errors

    def observations_by_camera(self) -> Iterator[tuple[CameraModel, NDArray[np.int64]]]:
        """Each camera with the rows of its observations."""
        camera_of_observation = self.camera_of_view[self.observation_views]
        for row, camera in enumerate(self.cameras):
            yield camera, np.flatnonzero(camera_of_observation == row)


def distinct(taken_by: Sequence[CameraModel]) -> tuple[tuple[CameraModel, ...], NDArray[np.int64]]:
    """The different cameras of K photographs, in the order in which they come first, and the row of each one's (K,)."""
    row_of = {id(camera): row for row, camera in reversed(list(enumerate(taken_by)))}
    firsts = sorted(row_of.values())
    rows = np.searchsorted(firsts, [row_of[id(camera)] for camera in taken_by]).astype(np.int64)
    return tuple(taken_by[row] for row in firsts), rows


def write_ply(path: Path, structure: Structure) -> None:
    """Write points in their colours, and each camera as a red line of points along its optical axis."""
    centres = structure.world_T_camera[:, :3, 3]
    length = _AXIS_LENGTH * float(np.linalg.norm(np.ptp(centres, axis=0)))
    steps = np.linspace(0.0, length, _AXIS_POINTS)
    axes = centres[:, None] + steps[:, None] * structure.world_T_camera[:, None, :3, 2]
    positions = np.concatenate([structure.points_world, axes.reshape(-1, 3)])
    colours = np.concatenate([structure.colours, np.tile(np.array(_CAMERA_COLOUR, np.uint8), (axes.size // 3, 1))])

    names = ("x", "y", "z", "red", "green", "blue")
    vertices = np.zeros(len(positions), dtype=list(zip(names, ["<f4"] * 3 + ["u1"] * 3, strict=True)))
    for name, column in zip(names, [*positions.T, *colours.T], strict=True):
        vertices[name] = column
    types = ["float"] * 3 + ["uchar"] * 3
    header = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        + [f"property {kind} {name}" for kind, name in zip(types, names, strict=True)]
        + ["end_header", ""]
    )
    path.write_bytes(header.encode("ascii") + vertices.tobytes())
