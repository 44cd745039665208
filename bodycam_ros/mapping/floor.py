"""Which way is up in a map that no board lies in: the floor that the wearer of the cameras stood on is level.

The worn cameras tell roughly, since a person is higher than broad, and which of two level planes is the floor: feet are
nearer to it than heads are to a ceiling.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.mapping.structure import Structure
from bodycam_ros.mapping.worn_keyframes import Moment
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_TRIALS = 4000
_REFINEMENTS = 5
_SEED = 1
_ABOVE = (
    0.98  # of all keyframes and landmarks: a hand may have been laid on the floor, and a wrong landmark be anywhere
)
_BENEATH = 3.0  # times the thickness: what is seen farther down would be seen through the floor
_MIN_LANDMARKS = 30


@dataclass(frozen=True)
class FloorSettings:
    """Which landmarks are a floor."""

    thickness: float = setting(
        0.015,
        limits=(0.001, 0.2),
        reason="of the floor over how far apart the worn cameras are; what lies on it is higher",
    )
    max_lean_deg: float = setting(
        35.0,
        unit="deg",
        limits=(5.0, 60.0),
        reason="between the floor's normal and the line along which the worn cameras are spread",
    )
    max_height: float = setting(
        0.5,
        limits=(0.05, 5.0),
        reason="of the lowest worn camera over the floor, over how far apart they are; a ceiling is farther away",
    )
    min_share: float = setting(
        0.02, limits=(0.001, 1.0), reason="of all landmarks that must lie on it, or there is no telling what is up"
    )


@dataclass(frozen=True)
class Floor:
    """A level plane.

    Attributes:
        map_R_world: (3, 3) turns the frame of the structure so that z is up.
        origin: (3,) in the structure, on the floor beneath the wearer.
        landmarks: how many lie on it.
        tilt_sigma_deg: how well they tell its tilt; not whether it is level.
    """

    map_R_world: Array
    origin: Array
    landmarks: int
    tilt_sigma_deg: float


def find_floor(structure: Structure, moments: Mapping[str, Moment], settings: FloorSettings) -> Floor | None:
    """The floor that the cameras were worn above; None if the map shows none.

    Args:
        structure: at any scale.
        moments: which camera took each photograph.
        settings: tolerances.
    """
    centres = structure.world_T_camera[:, :3, 3]
    taken_by = np.array([moments[name].camera for name in structure.names])
    worn = np.array([np.median(centres[taken_by == camera], axis=0) for camera in np.unique(taken_by)])
    if len(worn) < 2:
        return None
    middle = worn.mean(axis=0)
    along = np.linalg.svd(worn - middle)[2][0]
    extent = float(np.ptp((worn - middle) @ along))
    thickness = settings.thickness * extent
    points = structure.points_world
    floors = []
    for upwards in (along, -along):
        best = None
        for up, height in _planes(points, upwards, np.cos(np.radians(settings.max_lean_deg))):
            lowest = float(np.quantile(centres @ up, 1.0 - _ABOVE)) - height
            if not 0.0 < lowest < settings.max_height * extent:
                continue
            above = points @ up - height
            count = int(np.count_nonzero(np.abs(above) < thickness))
            if (best is None or count > best[0]) and np.mean(above > -_BENEATH * thickness) > _ABOVE:
                best = count, up, height
        if best is not None and best[0] >= max(_MIN_LANDMARKS, settings.min_share * len(points)):
            up, height, on_floor, tilt_sigma = _refined(points, best[1], best[2], thickness)
            floors.append((float((centres @ up - height).min()), up, height, on_floor, tilt_sigma))
    if not floors:
        return None
    _, up, height, on_floor, tilt_sigma = min(floors, key=lambda floor: floor[0])
    origin = middle - (middle @ up - height) * up
    return Floor(_upright(up), origin, on_floor, float(np.degrees(tilt_sigma)))


def _planes(points: Array, upwards: Array, least_cosine: float) -> Iterator[tuple[Array, float]]:
    """Unit normals and heights of planes through three points each, roughly across a direction."""
    random = np.random.default_rng(_SEED)
    corners = points[random.integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    cosines = normals @ upwards / np.maximum(lengths, 1e-12)
    for row in np.flatnonzero((np.abs(cosines) > least_cosine) & (lengths > 0.0)):
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


def _upright(up: Array) -> Array:
    """Rotation (3, 3) that turns a direction to z."""
    aside = np.eye(3)[int(np.abs(up).argmin())]
    x = np.cross(aside, up) / np.linalg.norm(np.cross(aside, up))
    return np.array([x, np.cross(up, x), up])
