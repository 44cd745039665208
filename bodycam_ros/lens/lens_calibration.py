"""The whole calibration of a lens: pictures of a board in, a lens with its uncertainty out."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.board_detector import BoardView, LensBoard, find_board
from bodycam_ros.boards.board_layout import CHECKERBOARD
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import Array
from bodycam_ros.lens.lens_fit import LensFit, as_model, fit_lens, fit_unplaced, initial_fit
from bodycam_ros.lens.lens_images import LensImage, illuminated_pixels
from bodycam_ros.lens.lens_quality import (
    TRUSTED_RADIUS,
    BoardCoverage,
    ValidatedLens,
    board_coverage,
    image_radius,
    objections,
    ray_grid,
    validate,
    warnings,
)
from bodycam_ros.progress import Progress, in_parallel

_MIN_VIEWS = 3  # as many as cameras' five to twelve numbers need
_MAX_VIEWS = 60  # sharp pictures; more add time, hardly truth
_TRIED_PICTURES = 12  # on which variants of the board are compared
_FLAT = 0.9  # share of the points that lie in a plane, from which on no other way of reading the board is tried
_MIN_SHARPNESS, _SHARP = 0.5, 75.0  # share of the better pictures' steepest edges; their percentile
_TAIL = 2.0  # times the median error; what is farther off counts little
_BEYOND_CHANCE = 2.0  # standard deviations
_ORDINARY_RAD = 1.1  # image radius over focal length, about the angle to the corners; more is a wide lens
_SIMPLEST_FIRST = {
    True: ("plumb_bob", "fov", "equidistant", "rational_polynomial"),
    False: ("equidistant", "fov", "plumb_bob", "rational_polynomial"),
}
"""Whether a lens is ordinary -> models in order of preference: a later one has to explain pictures better by more than
chance. On a narrow view a fisheye's four powers of the angle are near to each other, and cancel with huge numbers."""

_TWO_CAMERAS = 3.5  # standard deviations, by which groups of pictures have lenses of their own; alike lenses: -2 to 2.6
_LAST_NUMBER = re.compile(r"\d+(?=\D*$)")
_LEAST_GROUP = 4


@dataclass(frozen=True)
class LensCalibration:
    """A calibration.

    Attributes:
        chosen: the model that explains pictures left out best, or the given one.
        trials: all that were tried, in order of preference.
        area: where the board was seen.
        is_lit: (H, W) pixels that the lens shows anything in.
        given, found: pictures, and those of them that show the board.
        objections: why it must not be used, each with what to do.
        warnings: what makes it less certain, each with what to film.
        remark: how the board differs from its file; empty if it does not.
    """

    chosen: ValidatedLens
    trials: tuple[ValidatedLens, ...]
    area: BoardCoverage
    is_lit: NDArray[np.bool_]
    given: int
    found: int
    objections: tuple[str, ...]
    warnings: tuple[str, ...]
    remark: str


def calibrate_lens(
    pictures: Sequence[LensImage], board: LensBoard, models: Sequence[str], progress: Progress
) -> LensCalibration:
    """Measure a lens.

    Args:
        pictures: of the board, all of one size.
        board: what they show.
        models: to try; the simplest that is within chance of the best is chosen.
        progress: of its steps.

    Raises:
        LensError: too few pictures show the board for any lens, or they are of two cameras.
    """
    height, width = pictures[0].grey.shape
    is_lit = illuminated_pixels(pictures)
    board = _chosen_variant(pictures, board, progress)
    rough = _find(pictures, board, None, "finding the board", progress)
    if len(rough) < _MIN_VIEWS:
        raise LensError(
            f"{board.name}: {len(rough)} of {len(pictures)} pictures show this board; {_MIN_VIEWS} are needed, and "
            "8 or more make a good lens. Check that it is the file of this board. Film it from near by, still, "
            "in bright light, with all of it in the picture"
        )
    fit = initial_fit(rough, width, height)
    if board.layout.kind != CHECKERBOARD:
        # What was found without a lens is good to a pixel at best; and a lens finds more, where it bends much.
        fit = fit_unplaced(fit.camera, _find(pictures, board, fit.camera, "finding it through the lens", progress))
    found = len(fit.views)
    rows = _sharp_views(fit)
    fit = fit_lens(fit.camera, [fit.views[row] for row in rows], fit.poses[rows])
    reach = min(TRUSTED_RADIUS, board_coverage(fit, is_lit).reach)
    corners = ray_grid(is_lit, 1.0, beyond=reach)
    trials = []
    with progress.step("fitting lenses", len(models)) as advance:
        for model in sorted(models, key=simplest_first(fit, is_lit).index):
            trial = fit_lens(as_model(model, fit), fit.views, fit.poses)
            trials.append(validate(trial, ray_grid(is_lit, reach), corners))
            advance()
    best = _best(trials, ray_grid(is_lit))
    _check_one_camera(best, ray_grid(is_lit))
    area = board_coverage(best.fit, is_lit)
    return LensCalibration(
        best,
        tuple(trials),
        area,
        is_lit,
        len(pictures),
        found,
        tuple(objections(best)),
        tuple(warnings(best, area, board.layout.kind == CHECKERBOARD)),
        board.remark,
    )


def simplest_first(fit: LensFit, is_lit: NDArray[np.bool_]) -> tuple[str, ...]:
    """The models in order of preference, by a fitted lens and the pixels (H, W) that it shows anything in."""
    return _SIMPLEST_FIRST[image_radius(is_lit) < _ORDINARY_RAD * 0.5 * (fit.camera.fx + fit.camera.fy)]


def _chosen_variant(pictures: Sequence[LensImage], board: LensBoard, progress: Progress) -> LensBoard:
    """The way of reading the board that finds most of it; as described unless another finds clearly more."""
    step = max(1, len(pictures) // _TRIED_PICTURES)
    some = pictures[::step]
    best, most = board, -1.0
    for variant in board.variants():
        found = _find(some, variant, None, "comparing the board with its file", progress)
        points = float(sum(view.flat_points for view in found))
        if points > most:
            best, most = variant, 1.25 * points
        seen = sum(len(view.pixels) for view in found)
        if variant is board and len(found) > 0.5 * len(some) and points > _FLAT * seen:
            break
    return best


def _check_one_camera(together: ValidatedLens, grid: Array) -> None:
    """Refuse pictures whose names make groups that lenses of their own explain better, by more than chance."""
    fit = together.fit
    groups: dict[str, list[int]] = {}
    for row, view in enumerate(fit.views):
        groups.setdefault(_LAST_NUMBER.sub("*", view.name.split(" at ")[0]), []).append(row)
    large = {name: rows for name, rows in sorted(groups.items()) if len(rows) >= _LEAST_GROUP}
    if len(large) < 2:
        return
    gains, errors = [], []
    for rows in large.values():
        own = validate(fit_lens(fit.camera, [fit.views[row] for row in rows], fit.poses[rows]), grid, grid[:0])
        gains.append(_gains(own, together.errors_px[np.isin(fit.rows, rows)]))
        errors.append(own.median_px)
    if _is_beyond_chance(np.concatenate(gains), _TWO_CAMERAS):
        raise LensError(
            f"pictures {' and '.join(large)} were taken by different cameras: pictures held out are off by "
            f"{together.median_px:.3f} px by one lens, by {max(errors):.3f} px by lenses of their own; give the "
            f"pictures of one camera, as in {next(iter(large))}"
        )


def _sharp_views(fit: LensFit) -> NDArray[np.intp]:
    """Rows of the sharp pictures, evenly thinned out where there are many."""
    sharpness = np.array([view.sharpness for view in fit.views])
    sharp = np.flatnonzero(sharpness >= _MIN_SHARPNESS * np.percentile(sharpness, _SHARP))
    return sharp[:: -(-len(sharp) // _MAX_VIEWS)]


def _best(trials: Sequence[ValidatedLens], grid: Array) -> ValidatedLens:
    """The first that has a ray at all pixels (G, 2), and that no later one beats by more than chance."""
    finite = [trial for trial in trials if np.isfinite(trial.worst_ray_px)] or list(trials)
    whole = [trial for trial in finite if trial.fit.camera.unproject(grid)[1].all()] or finite
    best = whole[0]
    for trial in whole[1:]:
        if _is_beyond_chance(_gains(trial, best.errors_px), _BEYOND_CHANCE):
            best = trial
    return best


def _gains(lens: ValidatedLens, other_px: Array) -> Array:
    """Gain by which each picture (V,), left out, is explained by a lens than by another's errors (N,)."""
    one, other = lens.errors_px / lens.fit.spreads, other_px / lens.fit.spreads
    scale = _TAIL * min(float(np.median(one)), float(np.median(other)))
    gains = np.log1p((other / scale) ** 2) - np.log1p((one / scale) ** 2)
    return np.asarray(np.bincount(lens.fit.rows, gains), np.float64)


def _is_beyond_chance(gains: Array, sigmas: float) -> bool:
    """Whether the sum of gains, one a picture, is greater than by chance."""
    return bool(gains.sum() > sigmas * float(gains.std(ddof=1)) * np.sqrt(len(gains)))


def _find(
    pictures: Sequence[LensImage], board: LensBoard, camera: CameraModel | None, step: str, progress: Progress
) -> list[BoardView]:
    def find(picture: LensImage) -> BoardView | None:
        return find_board(picture.grey, picture.name, board, camera)

    with progress.step(step, len(pictures)) as advance:
        found = list(in_parallel(find, pictures, os.cpu_count() or 1, advance))
    return [view for view in found if view is not None]
