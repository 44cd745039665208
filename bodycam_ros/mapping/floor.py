"""The floor beneath the body cameras: origin of a map that has no board, and its vertical if no sensor measures it.

The body cameras give the vertical roughly, since a person is higher than broad, and separate the floor from the
ceiling: feet are nearer to the floor than heads are to a ceiling.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array, rotation_to_z
from bodycam_ros.mapping.structure import Structure

_THICKNESS = 0.015  # of the floor, over the extent of the body cameras
_MIN_COSINE = np.cos(np.radians(35.0))  # between the floor's normal and the line along which the cameras spread
_MAX_HEIGHT = 0.5  # of the lowest body camera over the floor, over their extent; a ceiling is farther away
_MIN_SHARE, _MIN_LANDMARKS = 0.02, 30  # of the landmarks that must lie on it
_ABOVE = 0.98  # of all keyframes and landmarks: a hand may touch the floor, a wrong landmark be anywhere
_BENEATH = 3.0  # in thicknesses; landmarks farther down would be seen through the floor
_TRIALS = 4000
_REFINEMENTS = 5
_SEED = 1


@dataclass(frozen=True, eq=False)
class Floor:
    """A level plane: the points whose component along ``up`` (3,), its unit normal, is ``height``.

    ``landmarks`` is the number on it.
    """

    up: Array
    height: float
    landmarks: int


def stand_on_floor(structure: Structure, up: Array | None) -> tuple[Structure, Floor | None]:
    """Turn and shift a structure of body cameras: z up, the origin on the floor beneath their middle.

    Args:
        structure: at any scale.
        up: (3,) unit vector in it, where sensors give it; None: the normal of the floor.

    Returns:
        The structure and the floor that was found in it. Without one the origin is as low as the lowest cameras if
        ``up`` is known, and the structure is unchanged if not.
    """
    floor = _find_floor(structure, up)
    if floor is None and up is None:
        return structure, None
    centres = structure.world_T_camera[:, :3, 3]
    up = floor.up if up is None and floor is not None else up
    assert up is not None
    height = float(np.quantile(centres @ up, 1.0 - _ABOVE)) if floor is None else floor.height
    R, middle = rotation_to_z(up), centres.mean(axis=0)
    return structure.transformed(1.0, R, -R @ (middle - (middle @ up - height) * up)), floor


def _find_floor(structure: Structure, up: Array | None) -> Floor | None:
    """The floor with a normal (3,), if that is known; None if the map shows none."""
    along, extent = body_extent(structure)
    if up is None and len(structure.cameras) < 2:
        return None
    centres = structure.world_T_camera[:, :3, 3]
    points = structure.points_world
    thickness = _THICKNESS * extent
    floors = []
    for upwards in (along, -along) if up is None else (up,):
        best = None
        for normal, height in _planes(points, upwards, turned=up is None):
            lowest = float(np.quantile(centres @ normal, 1.0 - _ABOVE)) - height
            if not 0.0 < lowest < _MAX_HEIGHT * extent:
                continue
            above = points @ normal - height
            count = int(np.count_nonzero(np.abs(above) < thickness))
            if (best is None or count > best.landmarks) and np.mean(above > -_BENEATH * thickness) > _ABOVE:
                best = Floor(normal, height, count)
        if best is not None and best.landmarks >= max(_MIN_LANDMARKS, _MIN_SHARE * len(points)):
            floors.append(_refined(points, best, thickness, turns=up is None))
    return min(floors, key=lambda floor: float((centres @ floor.up).min()) - floor.height, default=None)


def body_extent(structure: Structure) -> tuple[Array, float]:
    """Unit direction (3,) along which the body cameras are spread, up or down, and how far: that of their medians."""
    places = structure.world_T_camera[:, :3, 3]
    if len(structure.cameras) > 1:
        rows = np.unique(structure.camera_of_view)
        places = np.array([np.median(places[structure.camera_of_view == row], axis=0) for row in rows])
    along = np.linalg.svd(places - places.mean(axis=0))[2][0]
    return along, float(np.ptp(places @ along))


def _planes(points: Array, upwards: Array, *, turned: bool) -> Iterator[tuple[Array, float]]:
    """Unit normals and heights of planes: level ones through one point each, or ones through three, roughly level."""
    corners = points[np.random.default_rng(_SEED).integers(0, len(points), (_TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) if turned else upwards[None]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    normals = np.where(normals @ upwards < 0.0, -1.0, 1.0)[:, None] * normals
    for normal, corner in zip(np.broadcast_to(normals, (_TRIALS, 3)), corners[:, 0], strict=True):
        if normal @ upwards > _MIN_COSINE:
            yield normal, float(corner @ normal)


def _refined(points: Array, floor: Floor, thickness: float, *, turns: bool) -> Floor:
    """Least squares over the points that are near."""
    for _ in range(_REFINEMENTS):
        near = points[np.abs(points @ floor.up - floor.height) < thickness]
        middle, up = near.mean(axis=0), floor.up
        if turns:
            normal = np.linalg.svd(near - middle, full_matrices=False)[2][2]
            up = normal * np.sign(normal @ up)
        floor = Floor(up, float(middle @ up), len(near))
    return floor
