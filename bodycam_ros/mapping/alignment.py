"""Scale, origin and upward direction of a structure from its views of an AprilTag board.

The worn cameras tell roughly, since a person is higher than broad, and which of two level planes is the floor: feet are
nearer to it than heads are to a ceiling.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3, transform_points, umeyama
from bodycam_ros.mapping.apriltag import TagView
from bodycam_ros.mapping.board import Board, CornerViews, collect_corners, triangulate_corners
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.structure import Structure, distinct
from bodycam_ros.mapping.worn_keyframes import Moment
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

_MIN_CORNERS = 4  # one tag


@dataclass(frozen=True)
class AlignmentSettings:
    """How the board's corners are placed in the structure."""

    corner_noise: float = setting(
        0.05, unit="px", limits=(0.01, 5.0), reason="of a corner of a large tag, as measured; twice it counts linearly"
    )
    large_breadth: float = setting(
        50.0,
        unit="px",
        limits=(5.0, 500.0),
        reason="breadth below which a tag's noise grows with the square, as measured",
    )
    max_corner_error: float = setting(
        2.0,
        unit="px",
        limits=(0.2, 50.0),
        reason="views of a corner beyond it are left out when the corner is triangulated",
    )
    max_misfit: float = setting(
        1.2,
        unit="mrad",
        limits=(0.01, 1000.0),
        reason="median error of the board's corners beyond which there is no map; 0.05 to 1.0 with the right "
        "camera.yaml, 1.3 and more with another lens model or a focal length 20 % off",
    )
    fine_misfit: float = setting(
        0.5,
        unit="px",
        limits=(0.0, 50.0),
        reason="median error that is never refused: a fisheye's pixels are wider than max_misfit",
    )


@dataclass(frozen=True)
class BoardResidual:
    """How well the board fits the photographs after the alignment.

    Attributes:
        views_of_tag: tag -> number of photographs that measure it.
        rms_of_tag_px: tag -> root mean square distance of its corners from where the board projects [px].
        rms_of_tag_mm: tag -> root mean square distance of its triangulated corners from the board's [mm].
        rms_px, rms_mm: the same over all tags.
        median_px: median of those distances in the photographs, which a single wrong tag does not move.
        inset_px: how far blur moves each edge inwards; estimated with the alignment [px].
    """

    views_of_tag: Mapping[int, int]
    rms_of_tag_px: Mapping[int, float]
    rms_of_tag_mm: Mapping[int, float]
    rms_px: float
    rms_mm: float
    median_px: float
    inset_px: float


@dataclass(frozen=True)
class BoardAlignment:
    """Similarity from the frame of the structure to the frame of the map: x -> scale R x + t [m].

    The map's origin is the board's; ``map_R_board`` (3, 3) turns the board's axes to the map's.
    """

    scale: float
    R: Array
    t: Array
    map_R_board: Array
    residual: BoardResidual


def align_to_board(
    world_T_camera: Array,
    tag_views: Sequence[Sequence[TagView]],
    taken_by: Sequence[CameraModel],
    board: Board,
    settings: AlignmentSettings,
) -> BoardAlignment:
    """Find the similarity that puts a structure on its board.

    Args:
        world_T_camera: (K, 4, 4) poses of the registered photographs, in any frame and scale.
        tag_views: for each of them the tags that it shows.
        taken_by: the camera of each of them.
        board: what was printed.
        settings: noise and tolerance.

    Raises:
        MapError: too few views of the board to place it, or it does not fit, as with the intrinsics of another camera.
    """
    views = collect_corners(world_T_camera, tag_views, taken_by, board)
    triangulated = triangulate_corners(views, settings.max_corner_error)
    seen = [row for row, point in triangulated.items() if point is not None]
    if len(seen) < _MIN_CORNERS:
        raise MapError(
            f"board: only {len(seen)} of its corners can be placed from {len(tag_views)} registered photographs; "
            "take more photographs of it from different sides, near enough that a tag is 30 px or broader. If there "
            f"are enough: {wrong_camera(*distinct(taken_by)[0])}"
        )
    world_points = np.array([triangulated[row] for row in seen])
    board_points = np.concatenate(list(board.corners_board.values()))[seen]
    scale, R, t = umeyama(board_points, world_points, with_scale=True)
    scale, R, t, inset_px = _refine(views, scale, R, t, settings)
    residuals = _residuals(views, scale, R, t, inset_px)
    offsets = (world_points - t) @ R / scale - board_points
    residual = _report(views, residuals, np.array(seen), offsets, inset_px)
    # An angle, since pixels are finer in larger photographs.
    misfit_mrad = 1e3 * float(np.median(np.linalg.norm(residuals, axis=1) / views.focal_px))
    if misfit_mrad > settings.max_misfit and residual.median_px > settings.fine_misfit:
        raise MapError(
            f"board: its corners are {residual.median_px:.1f} px ({misfit_mrad:.1f} mrad, median) from where the "
            f"photographs should show them, expected {settings.max_misfit:g} mrad at most (alignment.max_misfit). "
            f"{wrong_camera(*distinct(taken_by)[0])} If it does, board.yaml may describe another board"
        )
    map_R_board = np.eye(3) if board.map_R_board is None else board.map_R_board
    map_R_world = map_R_board @ R.T
    return BoardAlignment(1.0 / scale, map_R_world, -map_R_world @ t / scale, map_R_board, residual)


def _refine(
    views: CornerViews, scale: float, R: Array, t: Array, settings: AlignmentSettings
) -> tuple[float, Array, Array, float]:
    """Least squares of the corners' pixels over the board's seven parameters and the inset of the tags' edges.

    The inset is seen in the gaps between tags, which blur widens as much as it shrinks the tags.
    """
    from scipy.optimize import least_squares

    def unpack(x: Array) -> tuple[float, Array, Array, float]:
        return scale * float(np.exp(x[0])), R @ exp_so3(x[1:4]), t + scale * x[4:7], float(x[7])

    growth = np.maximum(1.0, settings.large_breadth / views.breadths.min(axis=1)) ** 2
    noise = settings.corner_noise * growth[:, None]

    def cost(x: Array) -> Array:
        weighted: Array = _residuals(views, *unpack(x)) / noise
        return weighted.ravel()

    solution = least_squares(cost, np.zeros(8), loss="huber", f_scale=2.0, x_scale="jac")
    return unpack(solution.x)


def _residuals(views: CornerViews, scale: float, R: Array, t: Array, inset_px: float) -> Array:
    """Pixels (N, 2) from where the board projects, its tags shrunk by the inset, to where the corners were found."""
    shrink = 1.0 - 2.0 * inset_px / views.breadths[:, :, None]
    points_board = views.centre_board + shrink[:, 0] * views.half_width_board + shrink[:, 1] * views.half_height_board
    points_camera = transform_points(views.camera_T_world, (scale * points_board @ R.T + t)[:, None])[:, 0]
    residuals = np.zeros_like(views.pixels)
    for camera, rows in views.by_camera:
        projected, valid = camera.project(points_camera[rows])
        residuals[rows[valid]] = (views.pixels[rows] - projected)[valid]
    return residuals


def _report(
    views: CornerViews, residuals: Array, corner_rows: NDArray[np.int64], offsets: Array, inset_px: float
) -> BoardResidual:
    squares_px = np.sum(residuals**2, axis=1)
    squares_mm = np.sum((1e3 * offsets) ** 2, axis=1)
    tags = np.unique(views.tags).tolist()
    tag_of_corner = {int(row): int(tag) for row, tag in zip(views.corner_rows, views.tags, strict=True)}
    corner_tags = np.array([tag_of_corner[row] for row in corner_rows.tolist()])
    return BoardResidual(
        views_of_tag={tag: int(np.sum(views.tags == tag)) // 4 for tag in tags},
        rms_of_tag_px={tag: float(np.sqrt(squares_px[views.tags == tag].mean())) for tag in tags},
        rms_of_tag_mm={
            tag: float(np.sqrt(squares_mm[corner_tags == tag].mean())) for tag in tags if np.any(corner_tags == tag)
        },
        rms_px=float(np.sqrt(squares_px.mean())),
        rms_mm=float(np.sqrt(squares_mm.mean())),
        median_px=float(np.sqrt(np.median(squares_px))),
        inset_px=inset_px,
    )


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
