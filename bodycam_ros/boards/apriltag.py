"""AprilTags in photographs, with corners where the tags' edges meet.

Corner detectors use a few pixels around a corner, which blur rounds off towards the inside of the tag: those of
``cv2.aruco`` by 0.2 to 0.7 px (its AprilTag one errs by as much, to any side). Here each edge is a line through many
points of steepest brightness, fitted where the lens does not bend it, and a corner is where two lines meet, pulled by
0.002 px.

Detectors search for quadrilaterals with straight sides. With a wide lens they also search perspective views of parts of
the picture.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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


def find_tags(gray: Grey, camera: CameraModel | None, family: int) -> Iterator[tuple[int, Array]]:
    """Tags of a family of ``cv2.aruco`` with their corners (4, 2) [px], clockwise from the upper left of the print.

    The same tag may come more than once. With an unknown lens (None) tags whose edges are bent may be missing.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(family)
    yield from _detected(gray, dictionary)
    if camera is None:
        return
    for camera_R_view, focal_px, columns, rows in _views(camera):
        size = len(columns)
        view = cv2.remap(gray, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
        for tag, corners in _detected(np.asarray(view, np.uint8), dictionary):
            rays = np.column_stack([(corners - 0.5 * (size - 1)) / focal_px, np.ones(4)]) @ camera_R_view.T
            pixels, valid = camera.project(rays)
            if valid.all():
                yield tag, pixels


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


FAMILIES: Mapping[str, int] = {
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "36h10": cv2.aruco.DICT_APRILTAG_36h10,
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
}
_MIN_BREADTH_PX = 16.0  # of a tag; in narrower ones blur mixes edges with cells
_LINE_TOLERANCE_PX = 0.15  # median distance of edge points from their line; more is a bad edge
_EDGE_MARGIN = 0.12  # share of an edge at either end that the neighbouring edge's blur reaches
_REACH_OF_BREADTH = 0.07  # search across an edge; a tag's border and its quiet zone are 0.1 or more of its breadth
_MIN_REACH = 1.5  # [px]
_STEPS_PER_PIXEL = 4  # samples across an edge
_EDGE_BLUR = 0.7  # [px] smoothing before the steepest point is looked for
_BLUR_REACH = 3.2  # sigmas of that filter
_LINE_ITERATIONS = 5
_MIN_LINE_POINTS = 6


@dataclass(frozen=True)
class TagView:
    """One tag in one photograph.

    Attributes:
        tag: its number in the family.
        corners: (4, 2) float64 pixels in the order of cv2.aruco: clockwise from the top left of the printed tag.
        breadths: (2,) [px] distance between its left and right side, and between its upper and lower side.
    """

    tag: int
    corners: NDArray[np.float64]
    breadths: NDArray[np.float64]


def detect_tags(
    gray: NDArray[np.uint8],
    camera: CameraModel,
    family: int,
    min_breadth_px: float = _MIN_BREADTH_PX,
    tolerance_px: float = _LINE_TOLERANCE_PX,
) -> list[TagView]:
    """Find the tags of a family and refine their corners by their edges.

    Args:
        gray, camera: grey picture (rows, columns) and its lens.
        family: number in ``cv2.aruco``.
        min_breadth_px: of a tag.
        tolerance_px: median distance of an edge's points from its line.
    """
    views: dict[int, TagView] = {}
    picture = gray.astype(np.float32)
    for tag, rough in find_tags(gray, camera, family):
        breadths = breadths_of(rough)
        if tag in views or breadths.min() < min_breadth_px:
            continue
        corners = corners_of_edges(picture, rough, breadths, camera, tolerance_px)
        if corners is not None:
            views[tag] = TagView(tag, corners, breadths)
    return list(views.values())


def breadths_of(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Breadths (2,) of a quadrilateral (4, 2): its area over the mean length of either pair of sides."""
    diagonals = corners[2:] - corners[:2]
    area = 0.5 * abs(diagonals[0, 0] * diagonals[1, 1] - diagonals[0, 1] * diagonals[1, 0])
    upper, right, lower, left = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    return np.array([2.0 * area / (left + right), 2.0 * area / (upper + lower)])


def corners_of_edges(
    picture: NDArray[np.float32],
    rough: NDArray[np.float64],
    breadths: NDArray[np.float64],
    camera: CameraModel,
    tolerance: float,
) -> NDArray[np.float64] | None:
    """Where the four edge lines of a tag meet: pixels (4, 2), or None when an edge is not a clean line.

    Args:
        picture: grey (H, W).
        rough: (4, 2) about where the corners are, dark on the right of who goes from each to the next.
        breadths: (2,) of the tag.
        camera: the lens.
        tolerance: median distance of an edge's points from its line that is clean [px].
    """
    lines = []
    # Upper and lower edges are looked for across the tag's height, the others across its width.
    reaches = np.maximum(_MIN_REACH, _REACH_OF_BREADTH * breadths[[1, 0, 1, 0]])
    for start, end, reach in zip(rough, np.roll(rough, -1, axis=0), reaches.tolist(), strict=True):
        points = _edge_points(picture, camera, start, end, reach)
        bearings, valid = camera.unproject(points)
        bearings = bearings[valid]
        # Straight in space is a plane through the camera, whatever the lens does.
        normal = _fit_plane(bearings, tolerance / camera.fx)
        if normal is None:
            return None
        lines.append(normal)
    rays = np.array([np.cross(lines[i - 1], lines[i]) for i in range(4)])
    rays *= np.sign(np.sum(rays * camera.unproject(rough)[0], axis=1, keepdims=True))
    corners, valid = camera.project(rays)
    # A line that slid to another edge moves the corner by a cell or more.
    if not valid.all() or np.linalg.norm(corners - rough, axis=1).max() > 2.0 * reaches.max():
        return None
    return corners


def _edge_points(
    picture: NDArray[np.float32],
    camera: CameraModel,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """Points (N, 2) of steepest brightness across the edge from one corner to the next, dark on its right.

    Corners run clockwise in the image, so that the inside, which is black, lies to the right of an edge. The edge is
    looked for along what the lens makes of a straight line; there are none where it shows none.
    """
    from scipy.ndimage import gaussian_filter1d

    stations = np.linspace(_EDGE_MARGIN, 1.0 - _EDGE_MARGIN, max(_MIN_LINE_POINTS, int(np.linalg.norm(end - start))))
    chord, _ = camera.unproject(start + stations[:, None] * (end - start))
    first, last = camera.unproject(np.array([start, end]))[0]
    normal = np.cross(first, last) / np.linalg.norm(np.cross(first, last))
    line = camera.project(chord - (chord @ normal)[:, None] * normal)[0]
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    if not np.isfinite(outward).all():
        return np.zeros((0, 2))
    offsets = np.arange(-reach, reach + 1e-9, 1.0 / _STEPS_PER_PIXEL)
    grid = line[:, None] + offsets[:, None] * outward[:, None]
    # A wide kernel, so that the steepest point may lie anywhere between pixels; linear interpolation pulls it to their
    # middle.
    columns, rows = np.moveaxis(grid.astype(np.float32), -1, 0)
    profiles = cv2.remap(picture, columns, rows, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
    slope = gaussian_filter1d(
        profiles, _EDGE_BLUR * _STEPS_PER_PIXEL, axis=1, order=1, mode="nearest", truncate=_BLUR_REACH
    )
    peak = np.clip(slope.argmax(axis=1), 1, slope.shape[1] - 2)
    rows = np.arange(len(peak))
    left, middle, right = slope[rows, peak - 1], slope[rows, peak], slope[rows, peak + 1]
    curvature = left - 2.0 * middle + right
    shift = np.where(curvature < 0.0, 0.5 * (left - right) / np.minimum(curvature, -1e-12), 0.0)
    inside = (np.abs(shift) <= 1.0) & (middle > 0.0)
    at = offsets[0] + (peak + shift) / _STEPS_PER_PIXEL
    points: NDArray[np.float64] = (line + at[:, None] * outward)[inside]
    return points


def _fit_plane(bearings: NDArray[np.float64], tolerance: float) -> NDArray[np.float64] | None:
    """Unit normal (3,) of the plane through the origin and bearings (N, 3), outliers weighted down; None if unclean.

    The plane is fitted like a line on the image plane around the points, where all errors weigh about the same.
    """
    if len(bearings) < _MIN_LINE_POINTS:
        return None
    weights = np.ones(len(bearings))
    for _ in range(_LINE_ITERATIONS):
        _, vectors = np.linalg.eigh((bearings * weights[:, None]).T @ bearings)
        normal = vectors[:, 0]
        distances = np.abs(bearings @ normal)
        weights = 1.0 / (1.0 + (distances / tolerance) ** 2) ** 2
    return normal if float(np.median(distances)) < tolerance else None
