"""Where a picture shows AprilTags, roughly: also a fisheye picture, which bends their edges.

Detectors look for quadrilaterals with straight sides. Where a lens is wide, they look into perspective views of parts
of the picture as well.
"""

from collections.abc import Iterator
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import local_scales
from bodycam_ros.geometry import exp_so3

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_WIDE_DEG = 60.0  # from the axis to a corner of the picture: up to there a lens hardly bends an edge
_VIEW_DEG = 75.0  # a view's opening; at its corners it shows things twice as large as in its middle
_BETWEEN_DEG = 45.0  # neighbouring views, which have so much in common that a tag is whole in one of them
_FINER = 1.3  # scale of a view's middle over the picture's: what is small is found rather when it is enlarged


def find_tags(gray: Grey, camera: CameraModel, family: int) -> Iterator[tuple[int, Array]]:
    """Tags of a family of ``cv2.aruco`` with their corners (4, 2) [px], clockwise from the upper left of the print.

    The same tag may come more than once.
    """
    yield from find_tags_in_picture(gray, family)
    dictionary = cv2.aruco.getPredefinedDictionary(family)
    for camera_R_view, focal_px, columns, rows in _views(camera):
        size = len(columns)
        view = cv2.remap(gray, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
        for tag, corners in _detected(np.asarray(view, np.uint8), dictionary):
            rays = np.column_stack([(corners - 0.5 * (size - 1)) / focal_px, np.ones(4)]) @ camera_R_view.T
            pixels, valid = camera.project(rays)
            if valid.all():
                yield tag, pixels


def find_tags_in_picture(gray: Grey, family: int) -> Iterator[tuple[int, Array]]:
    """As ``find_tags``, of a lens that nobody knows: tags whose edges are bent may be missing."""
    yield from _detected(gray, cv2.aruco.getPredefinedDictionary(family))


def _detected(gray: Grey, dictionary: cv2.aruco.Dictionary) -> Iterator[tuple[int, Array]]:
    if hasattr(cv2.aruco, "ArucoDetector"):
        found, tags, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(gray)
    else:  # OpenCV 4.6
        found, tags, _ = cv2.aruco.detectMarkers(gray, dictionary)
    for tag, corners in zip([] if tags is None else np.reshape(tags, -1).tolist(), found, strict=True):
        yield int(tag), np.asarray(corners, np.float64).reshape(4, 2)


@lru_cache(maxsize=4)  # 15 MB each; photographs come camera by camera
def _views(camera: CameraModel) -> tuple[tuple[Array, float, NDArray[np.float32], NDArray[np.float32]], ...]:
    """Views that cover what the camera sees: camera_R_view (3, 3), focal length [px], and the maps of ``cv2.remap``."""
    border = np.array([[0, 0], [0.5, 0], [1, 0], [0, 0.5], [1, 0.5], [0, 1], [0.5, 1], [1, 1]])
    bearings, valid = camera.unproject(border * [camera.width - 1, camera.height - 1])
    widest = float(np.arccos(bearings[:, 2].min())) if valid.all() else camera.max_angle
    if np.degrees(widest) <= _WIDE_DEG:
        return ()
    table = local_scales(camera)
    views = []
    for angle, turn in _directions(widest):
        camera_R_view = exp_so3(np.array([-np.sin(turn), np.cos(turn), 0.0]) * angle)
        centre, seen = camera.project(camera_R_view[:, 2][None])
        if not (seen[0] and camera.in_image(centre)[0]):
            continue
        focal_px = _FINER * float(np.interp(np.cos(angle), np.linspace(-1.0, 1.0, len(table)), table))
        size = round(2.0 * focal_px * np.tan(np.radians(0.5 * _VIEW_DEG)))
        steps = (np.arange(size) - 0.5 * (size - 1)) / focal_px
        rays = np.stack([*np.meshgrid(steps, steps), np.ones((size, size))], axis=-1).reshape(-1, 3)
        pixels = np.nan_to_num(camera.project(rays @ camera_R_view.T)[0], nan=-1e4).astype(np.float32)
        columns, rows = pixels.T.reshape(2, size, size)
        views.append((camera_R_view, focal_px, np.ascontiguousarray(columns), np.ascontiguousarray(rows)))
    return tuple(views)


def _directions(widest: float) -> Iterator[tuple[float, float]]:
    """Angle to the axis and turn about it [rad] of rings of views."""
    between = np.radians(_BETWEEN_DEG)
    yield 0.0, 0.0
    for ring in range(1, round(widest / between) + 1):
        angle = ring * between
        count = int(np.ceil(2.0 * np.pi * np.sin(min(angle, 0.5 * np.pi)) / between))
        for turn in np.linspace(0.0, 2.0 * np.pi, count, endpoint=False):
            yield angle, float(turn)
