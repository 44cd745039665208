"""The place around a body in a video from outside: a grid on the floor, the map's landmarks, the way so far."""

import cv2
import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.drawing.picture_style import QUIET
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.scene_nodes import GRID, rgb
from bodycam_ros.view.shaded_body import Image

_REACH_M = 10  # of the grid, around what is looked at
_STEP_M = 0.25  # lines are drawn in pieces: one that passes the viewer is not lost
_SHIFT = 4
_POINT_PX = 1.6
_FADE = 0.55  # of a landmark's colour, towards white: the body stands out


def draw_place(
    picture: Image, lens: CameraModel, world_T_camera: Array, reference_map: ReferenceMap | None, way: Array
) -> None:
    """Draw it into a picture (H, W, 3) of blue, green, red.

    Args:
        picture: drawn into.
        lens, world_T_camera: of the viewer.
        reference_map: the place; None where static cameras are all that is known of it.
        way: (T, 2) of the root over the floor so far [m].
    """
    camera_T_world = inverse(world_T_camera)
    if reference_map is None or reference_map.gravity_aligned:
        for line in _grid(world_T_camera[:2, 3]):
            _draw_line(picture, lens, camera_T_world, line, GRID, 1)
    if reference_map is not None:
        points = transform_points(camera_T_world, reference_map.points_world)
        pixels = lens.project(points)[0]
        inside = np.isfinite(pixels).all(axis=1) & (points[:, 2] > 0.0)
        inside[inside] &= ((pixels[inside] > 0.0) & (pixels[inside] < [lens.width, lens.height])).all(axis=1)
        colours = 255.0 - (1.0 - _FADE) * (255.0 - reference_map.colours[inside].astype(np.float64))
        centres = np.round(pixels[inside] * (1 << _SHIFT)).astype(int).tolist()
        for centre, colour in zip(centres, colours[:, ::-1].tolist(), strict=True):
            cv2.circle(picture, centre, round(_POINT_PX * (1 << _SHIFT)), colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)
    _draw_line(picture, lens, camera_T_world, np.column_stack([way, np.zeros(len(way))]), QUIET, 2)


def _grid(around: Array) -> list[Array]:
    """Lines (N, 3) a metre apart on the floor."""
    x, y = np.round(around)
    along = np.arange(-_REACH_M, _REACH_M + _STEP_M, _STEP_M)
    lines = []
    for step in range(-_REACH_M, _REACH_M + 1):
        lines.append(np.column_stack([x + along, np.full(len(along), y + step), np.zeros(len(along))]))
        lines.append(np.column_stack([np.full(len(along), x + step), y + along, np.zeros(len(along))]))
    return lines


def _draw_line(
    picture: Image, lens: CameraModel, camera_T_world: Array, points_world: Array, colour: str, width: int
) -> None:
    """Draw the pieces (N, 3) of a line that are before the camera."""
    points = transform_points(camera_T_world, points_world)
    pixels = lens.project(points)[0]
    ahead = np.isfinite(pixels).all(axis=1) & (points[:, 2] > 0.1)
    pieces = np.stack([pixels[:-1], pixels[1:]], axis=1)[ahead[:-1] & ahead[1:]]
    pieces = pieces[(np.abs(pieces) < 1e4).all(axis=(1, 2))]
    fixed = list(np.round(pieces * (1 << _SHIFT)).astype(np.int32))
    cv2.polylines(picture, fixed, False, rgb(colour)[::-1], width, cv2.LINE_AA, _SHIFT)
