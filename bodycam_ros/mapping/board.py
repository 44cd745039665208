"""The AprilTag board that gives a map its scale, its origin and its upward direction, and its corners in the map."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.mapping.apriltag import FAMILIES, TagView
from bodycam_ros.mapping.structure import distinct
from bodycam_ros.mapping.triangulation import triangulate
from bodycam_ros.shown import shown
from bodycam_ros.yaml_file import read_yaml

_LARGEST_M = 100.0
"""Of a coordinate: a board is smaller."""
_UNEVEN = 0.1
"""Sides and diagonals of a printed square differ by less than this share; one mistyped corner by more."""

_MIN_ANGLE = 1e-3  # [rad] between the rays of a corner

_UP = re.compile(r"board (-?)([xyz]) is up")

# Corners run from the upper left clockwise: where they lie along a tag's width and height.
_WIDTH_SIGNS = np.array([[-1.0], [1.0], [1.0], [-1.0]])
_HEIGHT_SIGNS = np.array([[-1.0], [-1.0], [1.0], [1.0]])


@dataclass(frozen=True)
class Board:
    """A printed board of AprilTags.

    Attributes:
        family: AprilTag family.
        corners_board: tag -> (4, 3) corners [m] in the board frame, in the order of cv2.aruco.
        map_R_board: (3, 3) turns the board's upward axis to z; None if its placement does not tell what is up.
    """

    family: str
    corners_board: Mapping[int, Array]
    map_R_board: Array | None


def read_board(path: Path) -> Board:
    """Read a board's description.

    The file gives ``family``, ``corners_in_board`` (tag -> four corners [m] in the order of cv2.aruco) and
    ``placement``, free text in which "board z is up" (or x, y, -x, ...) says which axis of the board points up.

    Raises:
        MapError: the file is missing, not YAML, or lacks what it must have.
    """
    document = read_yaml(path, "board description", MapError)
    try:
        family = str(document["family"])
        corners = {int(tag): np.array(c, dtype=np.float64) for tag, c in document["corners_in_board"].items()}
        placement = str(document.get("placement", ""))
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError) as error:
        raise MapError(
            f"{path}: a board needs 'family' and 'corners_in_board' (tag: four corners [m]): {shown(str(error))}"
        ) from error
    if family not in FAMILIES:
        raise MapError(f"{path}: there is no AprilTag family {shown(family)}; known are {', '.join(FAMILIES)}")
    if not corners or any(c.shape != (4, 3) or not np.isfinite(c).all() for c in corners.values()):
        raise MapError(f"{path}: 'corners_in_board' must give each tag four corners of three finite numbers [m]")
    for tag, corners_tag in corners.items():
        if not _is_square(corners_tag):
            raise MapError(
                f"{path}: the corners of tag {tag} make no square; expected four corners [m] in order around the tag, "
                "in the order of cv2.aruco"
            )
    return Board(family, corners, _upright(placement))


def _is_square(corners: Array) -> bool:
    """Whether four corners (4, 3) are those of a square of a size that can be printed, in order around it."""
    if np.abs(corners).max() > _LARGEST_M:
        return False
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    diagonals = np.linalg.norm(corners[2:] - corners[:2], axis=1) / np.sqrt(2.0)
    lengths = np.concatenate([sides, diagonals])
    return bool(lengths.min() > 0.0 and np.ptp(lengths) <= _UNEVEN * lengths.max())


def _upright(placement: str) -> Array | None:
    """Rotation (3, 3) from board axes to axes with z up, or None if the placement does not say what is up."""
    match = _UP.search(placement)
    if match is None:
        return None
    axes = np.eye(3)
    number = "xyz".index(match[2])
    up = -axes[number] if match[1] else axes[number]
    # The board's x stays x where it can; a board on its short side takes y instead.
    x = axes[1] if number == 0 else axes[0]
    return np.array([x, np.cross(up, x), up])


@dataclass(frozen=True)
class CornerViews:
    """All views of board corners, one per row.

    A corner is its tag's centre plus half of the tag's width and half of its height, each with the corner's sign.

    Attributes:
        by_camera: each camera with the rows that it took.
        camera_T_world: (N, 4, 4) of the photograph.
        pixels: (N, 2) where it shows the corner.
        bearings: (N, 3) unit rays to it in the camera.
        centre_board, half_width_board, half_height_board: (N, 3) [m].
        breadths: (N, 2) of the tag in the photograph [px]; see ``TagView``.
        tags: (N,) numbers.
        corner_rows: (N,) number of the corner: four per tag, in the order of the board's description.
    """

    by_camera: tuple[tuple[CameraModel, NDArray[np.int64]], ...]
    camera_T_world: Array
    pixels: Array
    bearings: Array
    centre_board: Array
    half_width_board: Array
    half_height_board: Array
    breadths: Array
    tags: NDArray[np.int64]
    corner_rows: NDArray[np.int64]

    @cached_property
    def focal_px(self) -> Array:
        """(N,) focal length of the photograph's camera [px], by which pixels become angles."""
        focal = np.empty(len(self.pixels))
        for camera, rows in self.by_camera:
            focal[rows] = camera.fx
        return focal


def collect_corners(
    world_T_camera: Array, tag_views: Sequence[Sequence[TagView]], taken_by: Sequence[CameraModel], board: Board
) -> CornerViews:
    """Gather the views of all corners of a board.

    Args:
        world_T_camera: (K, 4, 4) poses of the photographs.
        tag_views: for each of them the tags that it shows; those of other boards are ignored.
        taken_by: the camera of each of them.
        board: what was printed.

    Raises:
        MapError: no photograph shows a tag of the board.
    """
    rows = [
        (pose, view, board.corners_board[view.tag], camera)
        for pose, views, camera in zip(inverse(world_T_camera), tag_views, taken_by, strict=True)
        for view in views
        if view.tag in board.corners_board
    ]
    if not rows:
        raise MapError(
            f"board: none of its tags ({board.family}: {', '.join(map(str, board.corners_board))}) is seen in the "
            "registered photographs; photograph it from near by, or leave the board out for a map without scale"
        )
    tags = np.array([view.tag for _, view, _, _ in rows])
    order = {tag: row for row, tag in enumerate(board.corners_board)}
    pixels = np.concatenate([view.corners for _, view, _, _ in rows])
    corners_board = np.array([corners for _, _, corners, _ in rows])
    cameras, camera_of_row = distinct([camera for _, _, _, camera in rows])
    by_camera = tuple((camera, np.flatnonzero(np.repeat(camera_of_row == k, 4))) for k, camera in enumerate(cameras))
    bearings = np.empty((len(pixels), 3))
    for camera, at in by_camera:
        bearings[at] = camera.unproject(pixels[at])[0]
    # The centre is the mean, so these are exact for squares and any other parallelogram.
    half_widths = (corners_board * _WIDTH_SIGNS).mean(axis=1)
    half_heights = (corners_board * _HEIGHT_SIGNS).mean(axis=1)
    return CornerViews(
        by_camera=by_camera,
        camera_T_world=np.repeat(np.array([pose for pose, _, _, _ in rows]), 4, axis=0),
        pixels=pixels,
        bearings=bearings,
        centre_board=np.repeat(corners_board.mean(axis=1), 4, axis=0),
        half_width_board=(_WIDTH_SIGNS * half_widths[:, None]).reshape(-1, 3),
        half_height_board=(_HEIGHT_SIGNS * half_heights[:, None]).reshape(-1, 3),
        breadths=np.repeat(np.array([view.breadths for _, view, _, _ in rows]), 4, axis=0),
        tags=np.repeat(tags, 4),
        corner_rows=np.array([4 * order[tag] + corner for tag in tags.tolist() for corner in range(4)]),
    )


def triangulate_corners(views: CornerViews, max_error_px: float) -> dict[int, Array]:
    """Corners of the board in the world (3,), by number, each from all photographs that agree on it."""
    R_transposed = np.swapaxes(views.camera_T_world[:, :3, :3], 1, 2)
    directions = (R_transposed @ views.bearings[:, :, None])[:, :, 0]
    centres = -(R_transposed @ views.camera_T_world[:, :3, 3:])[:, :, 0]
    corners = {}
    for corner in np.unique(views.corner_rows).tolist():
        kept = np.flatnonzero(views.corner_rows == corner)
        while len(kept) >= 2:
            found = triangulate(centres[None, kept], directions[None, kept], views.focal_px[None, kept])
            worst = int(found.errors_px[0].argmax())
            if found.errors_px[0, worst] <= max_error_px:
                if found.angles[0] > _MIN_ANGLE:
                    corners[corner] = found.points[0]
                break
            kept = np.delete(kept, worst)
    return corners
