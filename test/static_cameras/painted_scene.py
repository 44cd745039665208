"""Pictures of meshes by OpenCV alone: the farthest face is painted first. What the package's contours are held to."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import inverse, transform_points

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

_FINE = 2  # painted with so many times the pixels, across, so that borders are blended
_SUBPIXEL = 4  # bits
_NEAREST_M = 0.2


@dataclass(frozen=True, eq=False)
class Painted:
    """A mesh (V, 3) in the world [m], (F, 3) outward, and a colour for each face (F, 3) or (F, 1)."""

    vertices: Array
    faces: NDArray[np.integer]
    colours: Array


def opencv_pixels(camera: CameraModel, points_camera: Array) -> Array:
    """(N, 2) pixels of points (N, 3) before the camera."""
    K = np.array(camera.k).reshape(3, 3)
    points = np.ascontiguousarray(points_camera, np.float64).reshape(-1, 1, 3)
    if camera.distortion_model == "equidistant":
        bearings = np.ascontiguousarray(points[..., :2] / points[..., 2:])
        return cv2.fisheye.distortPoints(bearings, K, np.array(camera.distortion)).reshape(-1, 2)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(camera.distortion))[0].reshape(-1, 2)


def paint(camera: CameraModel, world_T_camera: Array, background: Image, things: Sequence[Painted]) -> Image:
    """Paint things over a background (H, W, C), with blended borders."""
    fine = cv2.resize(background, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_LINEAR)
    _fill(fine, camera, world_T_camera, things, _FINE)
    return np.asarray(cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.uint8)


def painted_labels(
    camera: CameraModel, world_T_camera: Array, things: Sequence[Painted], shrink: int, nobody: int
) -> Image:
    """(H / shrink, W / shrink) first numbers of the colours of what is in front, ``nobody`` where there is nothing."""
    labels = np.full((camera.height // shrink, camera.width // shrink), nobody, np.uint8)
    _fill(labels, camera, world_T_camera, things, 1.0 / shrink)
    return labels


def _fill(picture: Image, camera: CameraModel, world_T_camera: Array, things: Sequence[Painted], scale: float) -> None:
    camera_T_world = inverse(world_T_camera)
    corners = np.concatenate([transform_points(camera_T_world, thing.vertices)[thing.faces] for thing in things])
    colours = np.concatenate([thing.colours for thing in things])
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = ((outward * corners[:, 0]).sum(axis=1) < 0.0) & (corners[..., 2] > _NEAREST_M).all(axis=1)
    corners, colours = corners[shown], colours[shown]
    order = np.argsort(-np.linalg.norm(corners.mean(axis=1), axis=1))
    pixels = (opencv_pixels(camera, corners[order].reshape(-1, 3)) + 0.5) * scale - 0.5
    fixed = np.rint(pixels * 2**_SUBPIXEL).astype(np.int32).reshape(-1, 3, 2)
    for triangle, colour in zip(fixed, colours[order].tolist(), strict=True):
        cv2.fillConvexPoly(picture, triangle, colour, cv2.LINE_8, _SUBPIXEL)


def clutter(width: int, height: int, seed: int) -> Image:
    """A background of overlapping blocks in all colours, with grain."""
    random = np.random.default_rng(seed)
    picture = np.full((height, width, 3), 128, np.uint8)
    for _ in range(150):
        x, y = random.integers(0, width), random.integers(0, height)
        size = random.integers(15, 120, 2)
        colour = random.integers(20, 235, 3).tolist()
        cv2.rectangle(picture, (int(x), int(y)), (int(x + size[0]), int(y + size[1])), colour, -1)
    return grained(picture, random)


def grained(picture: Image, random: np.random.Generator) -> Image:
    """A picture with the noise of a sensor, 4 grey levels."""
    return np.clip(picture + random.normal(0.0, 4.0, picture.shape), 0, 255).astype(np.uint8)
