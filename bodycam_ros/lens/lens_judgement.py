"""Whether a calibration will hurt, and what to film to mend it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.lens.board_detector import turned_to
from bodycam_ros.lens.lens_fit import LensFit
from bodycam_ros.lens.lens_settings import LensSettings
from bodycam_ros.lens.lens_validation import Validation
from bodycam_ros.lens.sight_choice import CELLS, cells_of

TRUSTED_RADIUS = 0.9
"""Of the image radius, up to which rays must be right."""

_GRID = (25, 33)
_APART = np.cos(np.radians(15.0))
_REACHED = 99.5  # percentile of the points' distances from the centre
_LIT = 0.5  # of a cell that must be lit to be one
_LEAST_POINTS = 2  # in a cell


@dataclass(frozen=True)
class SeenArea:
    """Where in the picture the board was seen.

    Attributes:
        is_lit, is_covered: (rows, columns) of cells; lit are those that the lens shows anything in.
        radius_px: of the lit part around the image's centre.
        reach: share of it out to which points were seen.
        tilts: ways in which the board was turned.
    """

    is_lit: NDArray[np.bool_]
    is_covered: NDArray[np.bool_]
    radius_px: float
    reach: float
    tilts: int

    @property
    def coverage(self) -> float:
        """Share of lit cells with points."""
        return float((self.is_covered & self.is_lit).sum() / max(1, self.is_lit.sum()))


def image_radius(is_lit: NDArray[np.bool_]) -> float:
    """Distance of the outermost lit pixels from the centre of the picture (H, W) [px]."""
    return float(np.percentile(_from_centre(is_lit)[is_lit], 99.9)) if is_lit.any() else 0.0


def ray_grid(is_lit: NDArray[np.bool_]) -> Array:
    """Lit pixels (G, 2) up to the radius that is to be trusted."""
    height, width = is_lit.shape
    rows, columns = np.linspace(0, height - 1, _GRID[0]), np.linspace(0, width - 1, _GRID[1])
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    at = grid.round().astype(int)
    inside = np.linalg.norm(grid - 0.5 * np.array([width - 1, height - 1]), axis=1)
    trusted: Array = grid[is_lit[at[:, 1], at[:, 0]] & (inside <= TRUSTED_RADIUS * image_radius(is_lit))]
    return trusted


def seen_area(fit: LensFit, is_lit: NDArray[np.bool_]) -> SeenArea:
    """Where the board was seen, in a picture of which some pixels (H, W) are lit."""
    height, width = is_lit.shape
    every = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(np.float64)
    cells = cells_of(every, width, height)
    share = np.bincount(cells, is_lit.ravel().astype(np.float64)) / np.bincount(cells)
    points = np.bincount(cells_of(fit.pixels, width, height), minlength=CELLS[0] * CELLS[1])
    radius = image_radius(is_lit)
    distances = np.linalg.norm(fit.pixels - 0.5 * np.array([width - 1, height - 1]), axis=1)
    return SeenArea(
        is_lit=(share >= _LIT).reshape(CELLS),
        is_covered=(points >= _LEAST_POINTS).reshape(CELLS),
        radius_px=radius,
        reach=min(1.0, float(np.percentile(distances, _REACHED)) / radius),
        tilts=_distinct(_faces_in_sight(fit.poses)),
    )


def objections(
    fit: LensFit, validation: Validation, area: SeenArea, settings: LensSettings, sharp: int
) -> list[tuple[str, str]]:
    """Why the lens must not be used, each with what to film; none if it may.

    Args:
        fit: the lens.
        validation: of it.
        area: where the board was seen.
        settings: the limits.
        sharp: pictures that were sharp enough to take.
    """
    found = []
    if sharp < settings.min_pictures:
        found.append(
            (
                f"{sharp} sharp pictures show the board, {settings.min_pictures} or more are needed",
                "film for a minute, the board still while the camera looks, in bright light",
            )
        )
    if area.coverage < settings.min_coverage:
        found.append(
            (
                f"the board was seen in {area.coverage:.1%} of the picture, less than {settings.min_coverage:.0%}",
                f"bring the board to the {_where_lacking(area)} of the picture",
            )
        )
    if area.reach < settings.min_reach:
        found.append(
            (
                f"it was seen out to {area.reach:.1%} of the image radius, less than {settings.min_reach:.0%}",
                "bring the board out to the corners, close by, so that it is cut off by the border",
            )
        )
    if area.tilts < settings.min_tilts:
        found.append(
            (
                f"it was turned in {area.tilts} ways only, {settings.min_tilts} or more are needed",
                "tilt the board by 30 to 45 deg to the left, the right, up and down, and turn it in its plane",
            )
        )
    if validation.median_px > settings.max_error:
        found.append(
            (
                f"pictures that were left out are off by {validation.median_px:.2f} px (median), more than "
                f"{settings.max_error:g} px",
                "try another --model; see that the board is flat and its file right; hold it still while you film",
            )
        )
    if not validation.worst_ray_px <= settings.max_ray_error:
        off = f"{validation.worst_ray_px:.2f} px" if np.isfinite(validation.worst_ray_px) else "without bound"
        found.append(
            (
                f"lenses of fewer pictures differ by {off} within {TRUSTED_RADIUS:.0%} of the image radius, more than "
                f"{settings.max_ray_error:g} px",
                "film more: the board large, near, tilted, and in the corners; or take a --model with fewer numbers",
            )
        )
    return found


def _faces_in_sight(poses: Array) -> Array:
    """(V, 3) the boards' faces as somebody sees them who looks straight at each."""
    sights = poses[:, :3, 3] / np.linalg.norm(poses[:, :3, 3], axis=1, keepdims=True)
    turns = np.array([turned_to(sight) for sight in sights])
    faces: Array = np.einsum("vij,vj->vi", turns, poses[:, :3, 2])
    return faces


def _distinct(faces: Array) -> int:
    """How many of the directions (V, 3) are apart from each other."""
    kept: list[Array] = []
    for face in faces:
        if all(float(face @ other) < _APART for other in kept):
            kept.append(face)
    return len(kept)


def _where_lacking(area: SeenArea) -> str:
    """The parts of the picture, in words, where the board was seen least."""
    lacking = area.is_lit & ~area.is_covered
    parts = []
    for down, upper in enumerate(("upper", "middle", "lower")):
        for across, left in enumerate(("left", "middle", "right")):
            rows, columns = (np.array_split(np.arange(n), 3)[k] for n, k in zip(CELLS, (down, across), strict=True))
            cells = np.ix_(rows, columns)
            if lacking[cells].sum() > 0.5 * max(1, area.is_lit[cells].sum()):
                parts.append("centre" if upper == left else f"{upper} {left}")
    return ", ".join(parts) or "border"


def _from_centre(picture: NDArray[np.bool_]) -> Array:
    height, width = picture.shape
    down, across = np.mgrid[:height, :width]
    distances: Array = np.hypot(across - 0.5 * (width - 1), down - 0.5 * (height - 1))
    return distances
