"""A body's surface painted into a picture, lit from the viewer's side, without a graphics card.

Within a segment the farthest faces are painted first; between segments, which run into each other at the joints, the
nearest point of each pixel's ray shows. Twice as many pixels across as the picture has make its edges smooth.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.outside.surface import Surface

Image = NDArray[np.uint8]

_LIGHT = np.array([-0.35, -0.75, -0.55]) / np.linalg.norm([-0.35, -0.75, -0.55])
"""Towards the light, in the camera's axes: above the viewer's left shoulder."""

_SHADE, _LIT = 0.55, 1.12  # of a face turned from the light, and towards it
_FINER = 2
_FAR_PX = 8000.0  # OpenCV's coordinates are 32 bits
_NEAREST_M = 0.03  # what is nearer fills the picture, and belongs to the camera's own mount
_LONGEST_PX = 400.0  # of a face's side: longer ones cross the rim of a fisheye's field
_FLAT = -1e-6  # cosine between a ray and a face along it


def paint_body(
    picture: Image,
    surfaces: Mapping[str, Surface],
    world_T_segment: Mapping[str, Array],
    colours: Mapping[str, tuple[int, int, int]],
    world_T_camera: Array,
    lens: CameraModel,
    opacity: float = 1.0,
) -> None:
    """Paint a body over a picture (H, W, 3).

    Args:
        picture: that it is painted into.
        surfaces: segment -> its surface.
        world_T_segment: segment -> (4, 4) where it is [m].
        colours: segment -> its colour, in the order of the picture's channels.
        world_T_camera: (4, 4) of the camera's optical frame [m].
        lens: of the camera.
        opacity: of the body: 1 hides what is behind it.
    """
    height, width = picture.shape[:2]
    camera_T_world = inverse(world_T_camera)
    nearest = np.full((_FINER * height, _FINER * width), np.inf, np.float32)
    shown = np.zeros((*nearest.shape, 3), np.float32)
    for segment, surface in surfaces.items():
        faces = _Faces.seen(surface, camera_T_world @ world_T_segment[segment], lens)
        if len(faces.corners):
            _paint_segment(nearest, shown, faces, np.asarray(colours[segment], np.float64), lens)
    size = (width, height)
    share = cv2.resize(np.isfinite(nearest).astype(np.float32), size, interpolation=cv2.INTER_AREA)[:, :, None]
    painted = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA), np.float32)
    picture[:] = np.clip((1.0 - opacity * share) * picture + opacity * painted, 0.0, 255.0).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces that turn to the camera and that it sees, the farthest first, in the camera's axes.

    Attributes:
        corners: (F, 3, 2) in the finer picture [px].
        normals: (F, 3)
        offsets: (F,) of their planes along the normals [m].
        depths: (F, 2) from the camera to their nearest and farthest corner [m].
    """

    corners: NDArray[np.int32]
    normals: Array
    offsets: Array
    depths: Array

    @classmethod
    def seen(cls, surface: Surface, camera_T_segment: Array, lens: CameraModel) -> "_Faces":
        towards = np.flatnonzero(surface.faces_towards(inverse(camera_T_segment)[:3, 3]))
        points = transform_points(camera_T_segment, surface.vertices)
        faces = surface.faces[towards]
        pixels = lens.project(points)[0][faces]
        with np.errstate(invalid="ignore"):
            sides = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).max(axis=1)
            seen = np.isfinite(pixels).all(axis=(1, 2)) & (np.abs(pixels) < _FAR_PX).all(axis=(1, 2))
            seen &= sides < _LONGEST_PX
        far = np.linalg.norm(points, axis=1)[faces]
        rows = np.flatnonzero(seen & (far.min(axis=1) > _NEAREST_M))
        rows = rows[np.argsort(-far[rows].mean(axis=1))]
        normals = surface.face_normals[towards[rows]] @ camera_T_segment[:3, :3].T
        offsets = (normals * points[faces[rows, 0]]).sum(axis=1)
        corners = np.round((pixels[rows] + 0.5) * _FINER - 0.5).astype(np.int32)
        return cls(corners, normals, offsets, np.stack([far[rows].min(axis=1), far[rows].max(axis=1)], axis=1))


def _paint_segment(
    nearest: NDArray[np.float32], shown: NDArray[np.float32], faces: _Faces, colour: Array, lens: CameraModel
) -> None:
    """Paint a segment where it is nearer than what is there."""
    low = np.maximum(faces.corners.min(axis=(0, 1)), 0)
    high = np.minimum(faces.corners.max(axis=(0, 1)) + 1, [nearest.shape[1], nearest.shape[0]])
    if (high <= low).any():
        return
    numbers = np.zeros((high[1] - low[1], high[0] - low[0]), np.float32)  # whole ones, exact up to 2^24
    for number, corners in enumerate(faces.corners - low.astype(np.int32), start=1):
        cv2.fillConvexPoly(numbers, corners, float(number))
    rows, columns = np.nonzero(numbers)
    face = numbers[rows, columns].astype(int) - 1
    rays, is_seen = lens.unproject((np.stack([columns, rows], axis=1) + low + 0.5) / _FINER - 0.5)
    slope = np.minimum((rays * faces.normals[face]).sum(axis=1), _FLAT)
    # Beside its outline, which is drawn to whole pixels, a face goes no further than its corners.
    depth = np.clip(faces.offsets[face] / slope, *faces.depths[face].T)
    rows, columns = rows + low[1], columns + low[0]
    is_front = is_seen & (depth < nearest[rows, columns])
    rows, columns, face = rows[is_front], columns[is_front], face[is_front]
    nearest[rows, columns] = depth[is_front]
    lit = _SHADE + (_LIT - _SHADE) * 0.5 * (1.0 + faces.normals[face] @ _LIGHT)
    shown[rows, columns] = np.clip(lit[:, None] * colour, 0.0, 255.0)
