"""The first images of static cameras side by side, with the contours of a body that a person places."""

from collections.abc import Mapping
from dataclasses import replace
from math import ceil

import cv2
import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.results.camera_picture import draw_polyline, project_bone
from bodycam_ros.results.colours import EQUIPMENT, side_colour
from bodycam_ros.static_cameras.contour_painting import Window, bgr, cut_out, paint_contour, square_window
from bodycam_ros.static_cameras.static_camera import Image, RegionModel
from bodycam_ros.viewer.scene import SELECTED

_TILE_PX, _GAP_PX = 480, 4  # of each camera's square, and between two
_MARK_PX, _MARK_WIDTH_PX = 14, 2
_TEXT_AT, _TEXT_SCALE = (12, 44), 1.3  # legible where three images share the panel


class PlacingPicture:
    """Draws the body into the images.

    Args:
        body: its segments.
        views: of the cameras, which find the body's contours as they do in a replay.
        images: camera -> (H, W, 3) blue, green, red; one or more.

    Attributes:
        is_close_up: whether images are cut to the body, where it was when this was set; else they are whole.
    """

    def __init__(self, body: BodyModel, views: Mapping[str, RegionModel], images: Mapping[str, Image]) -> None:
        self._body = body
        self._views = views
        self._images = images
        self._colours = [EQUIPMENT if s in body.equipment_segments else side_colour(s) for s in body.segments]
        self.cut(False)

    def cut(self, is_close_up: bool) -> None:
        """Show the images cut to the body that is drawn next, or whole."""
        self.is_close_up = is_close_up
        self._parts: dict[str, tuple[Window, Image]] = {}

    def draw(self, world_T_segment: Array, selected: str) -> Image:
        """One picture (H, W, 3), red, green, blue, of all images with the body at poses (S, 4, 4) over them.

        The origin of the segment ``selected`` is marked.
        """
        limbs = [bone for bone in body_bones(self._body, world_T_segment) if not bone.is_equipment]
        origin = world_T_segment[self._body.segment_index[selected], :3, 3]
        tiles = [self._tile(name, world_T_segment, limbs, origin) for name in self._images]
        columns = min(3, ceil(len(tiles) ** 0.5))
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % columns)
        rows = [np.concatenate(tiles[row : row + columns], axis=1) for row in range(0, len(tiles), columns)]
        return np.ascontiguousarray(np.concatenate(rows)[..., ::-1])

    def _tile(self, name: str, world_T_segment: Array, limbs: list[Bone], origin: Array) -> Image:
        view, image = self._views[name], self._images[name]
        camera, world_T_camera = view.station.camera, view.station.world_T_camera
        contour = view.find_contour(world_T_segment)
        if name not in self._parts:
            window = square_window(image, contour.covered if self.is_close_up else None)
            window = replace(window, times=(_TILE_PX - _GAP_PX) / window.width)
            self._parts[name] = window, cut_out(image, window)
        window, part = self._parts[name]
        tile = paint_contour(part, contour, np.zeros(len(contour.pixels)), self._colours, window)
        for limb in limbs:
            line = window.place(project_bone(camera, world_T_camera, limb))
            draw_polyline(tile, line, side_colour(limb.segment), 1, is_bgr=True)
        pixels, valid = camera.project(transform_points(inverse(world_T_camera), origin[None]))
        if valid[0]:
            at = np.clip(window.place(pixels[0]), -_TILE_PX, 2 * _TILE_PX).round().astype(int).tolist()
            cv2.drawMarker(tile, at, bgr(SELECTED), cv2.MARKER_CROSS, _MARK_PX, _MARK_WIDTH_PX, cv2.LINE_AA)
        for colour, width in (("#000000", 10), ("#ffffff", 3)):
            font = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(tile, name, _TEXT_AT, font, _TEXT_SCALE, bgr(colour), width, cv2.LINE_AA)
        return np.asarray(cv2.copyMakeBorder(tile, 0, _GAP_PX, 0, _GAP_PX, cv2.BORDER_CONSTANT, value=(255,) * 3))
