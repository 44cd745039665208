"""The floor beneath the body cameras, which gives a vertical where no board does.

The body cameras give it roughly, since a person is higher than broad, and separate the floor from the ceiling: feet are
nearer to the floor than heads are to a ceiling.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.structure import Structure

Array = NDArray[np.float64]

_THICKNESS = 0.015  # of the floor, over the extent of the body cameras
_MIN_COSINE = np.cos(np.radians(35.0))  # between the floor's normal and the line along which the cameras spread
_MAX_HEIGHT = 0.5  # of the lowest body camera over the floor, over their extent; a ceiling is farther away
_MIN_SHARE, _MIN_LANDMARKS = 0.02, 30  # of the landmarks that must lie on it
_ABOVE = 0.98  # of all keyframes and landmarks: a hand may touch the floor, a wrong landmark be anywhere
_BENEATH = 3.0  # in thicknesses; landmarks farther down would be seen through the floor
_TRIALS = 4000
_REFINEMENTS = 5
_SEED = 1


@dataclass(frozen=True)
class Floor:
    """A level plane.

    Attributes:
        map_R_world: (3, 3) turns the frame of the structure so that z is up.
        origin: (3,) in the structure, on the floor beneath the person.
        landmarks: number on it.
        tilt_sigma_deg: of the plane through them; not whether the floor is level.
    """

    map_R_world: Array
    origin: Array
    landmarks: int
    tilt_sigma_deg: float


def find_floor(structure: Structure, photographs: Photographs) -> Floor | None:
    """The floor beneath the body cameras; None if the map shows none.

    Args:
        structure: at any scale.
        photographs: with the camera of each.
    """
    centres = structure.world_T_camera[:, :3, 3]
    cameras = np.array([photographs.origins[name].camera for name in structure.names])
    places = np.array([np.median(centres[cameras == camera], axis=0) for camera in np.unique(cameras)])
    if len(places) < 2:
        return None
    middle = places.mean(axis=0)
    along = np.linalg.svd(places - middle)[2][0]
    extent = float(np.ptp((places - middle) @ along))
    thickness = _THICKNESS * extent
    points = structure.points_world
    floors = []
    for upwards in (along, -along):
        best = None
        for up, height in _planes(points, upwards):
            lowest = float(np.quantile(centres @ up, 1.0 - _ABOVE)) - height
            if not 0.0 < lowest < _MAX_HEIGHT * extent:
                continue
            above = points @ up - height
            count = int(np.count_nonzero(np.abs(above) < thickness))
            if (best is None or count > best[0]) and np.mean(above > -_BENEATH * thickness) > _ABOVE:
                best = count, up, height
        if best is not None and best[0] >= max(_MIN_LANDMARKS, _MIN_SHARE * len(points)):
            up, height, on_floor, tilt_sigma = _refined(points, best[1], best[2], thickness)
            floors.append((float((centres @ up - height).min()), up, height, on_floor, tilt_sigma))
    if not floors:
        return None
    _, up, height, on_floor, tilt_sigma = min(floors, key=lambda floor: floor[0])
    return Floor(upright_axes(up), middle - (middle @ up - height) * up, on_floor, float(np.degrees(tilt_sigma)))


def _planes(points: Array, upwards: Array) -> Iterator[tuple[Array, float]]:
    """Unit normals and heights of planes through three points each, roughly across a direction."""
    random = np.random.default_rng(_SEED)
    corners = points[random.integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    cosines = normals @ upwards / np.maximum(lengths, 1e-12)
    for row in np.flatnonzero((np.abs(cosines) > _MIN_COSINE) & (lengths > 0.0)):
        up = normals[row] * np.sign(cosines[row]) / lengths[row]
        yield up, float(corners[row, 0] @ up)


def _refined(points: Array, up: Array, height: float, thickness: float) -> tuple[Array, float, int, float]:
    """Least squares over the points that are near: normal, height, how many, and the sigma of its tilt [rad]."""
    for _ in range(_REFINEMENTS):
        near = points[np.abs(points @ up - height) < thickness]
        middle = near.mean(axis=0)
        _, spreads, axes = np.linalg.svd(near - middle, full_matrices=False)
        up = axes[2] * np.sign(axes[2] @ up)
        height = float(middle @ up)
    return up, height, len(near), float(spreads[2] / spreads[1] / np.sqrt(len(near)))


def upright_axes(up: Array) -> Array:
    """Rotation (3, 3) that turns a unit direction to z."""
    aside = np.eye(3)[int(np.abs(up).argmin())]
    x = np.cross(aside, up) / np.linalg.norm(np.cross(aside, up))
    return np.array([x, np.cross(up, x), up])
