"""The whole calibration of a lens: pictures of a board in, a judged lens out."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError
from bodycam_ros.geometry import Array
from bodycam_ros.lens.board_detector import BoardSight, LensBoard, find_board
from bodycam_ros.lens.lens_fit import LensFit, as_model, first_fit, fit_lens, placed_fit
from bodycam_ros.lens.lens_judgement import SeenArea, objections, ray_grid, seen_area
from bodycam_ros.lens.lens_pictures import LensPicture, lit
from bodycam_ros.lens.lens_settings import LensSettings
from bodycam_ros.lens.lens_validation import Validation, validate
from bodycam_ros.lens.sight_choice import choose_sights
from bodycam_ros.mapping.progress import Progress, in_parallel

_LEAST_SIGHTS = 4
_TAIL = 2.0  # times the median error; what is farther off says little
_BEYOND_CHANCE = 2.0  # standard deviations


@dataclass(frozen=True)
class ModelTrial:
    """A camera model that was tried."""

    model: str
    fit: LensFit
    validation: Validation


@dataclass(frozen=True)
class LensCalibration:
    """What came of it.

    Attributes:
        chosen: the model that explains pictures left out best, or the one that was asked for.
        trials: all that were tried, the simplest first.
        area: where the board was seen.
        is_lit: (H, W) pixels that the lens shows anything in.
        looked_at, found: pictures, and those of them that show the board.
        objections: why it must not be used, each with what to film.
    """

    chosen: ModelTrial
    trials: tuple[ModelTrial, ...]
    area: SeenArea
    is_lit: NDArray[np.bool_]
    looked_at: int
    found: int
    objections: tuple[tuple[str, str], ...]


def calibrate_lens(
    pictures: Sequence[LensPicture],
    board: LensBoard,
    models: Sequence[str],
    settings: LensSettings,
    progress: Progress,
) -> LensCalibration:
    """Measure a lens.

    Args:
        pictures: of the board, all of one size.
        board: what they show.
        models: to try; the best is chosen.
        settings: limits.
        progress: of its steps.

    Raises:
        LensError: too few pictures show the board for any lens.
    """
    height, width = pictures[0].grey.shape
    is_lit = lit(pictures)
    rough = _find(pictures, board, None, "looking for the board", progress)
    _require(rough, pictures, board)
    fit = first_fit(rough, width, height)
    # What was found without a lens is good to a pixel at best; and a lens finds more, where it bends much.
    shown = pictures if board.dictionary is not None else _named(pictures, rough)
    fit = placed_fit(fit.camera, _find(shown, board, fit.camera, "looking through the lens", progress))
    count = len(fit.sights)
    chosen = choose_sights(fit.sights, fit.poses, width, height, settings.taken, settings.min_sharpness)
    taken = _named(pictures, [fit.sights[row] for row in chosen])
    # Edges are as straight as the lens says.
    fit = placed_fit(fit.camera, _find(taken, board, fit.camera, "measuring", progress))
    trials = _tried(models, fit, ray_grid(is_lit), progress)
    best = _best(trials)
    area = seen_area(best.fit, is_lit)
    against = objections(best.fit, best.validation, area, settings, len(best.fit.sights))
    return LensCalibration(best, tuple(trials), area, is_lit, len(pictures), count, tuple(against))


def _tried(models: Sequence[str], fit: LensFit, grid: Array, progress: Progress) -> list[ModelTrial]:
    trials = []
    with progress.step("fitting lenses", len(models)) as advance:
        for model in models:
            trial = fit_lens(as_model(model, fit), fit.sights, fit.poses)
            trials.append(ModelTrial(model, trial, validate(trial, grid)))
            advance()
    return trials


def _best(trials: Sequence[ModelTrial]) -> ModelTrial:
    """The simplest that has a ray everywhere, and that none with more numbers beats by more than chance."""
    whole = [trial for trial in trials if np.isfinite(trial.validation.worst_ray_px)] or list(trials)
    best = whole[0]
    for trial in whole[1:]:
        if _is_better(trial.validation, best.validation):
            best = trial
    return best


def _is_better(one: Validation, other: Validation) -> bool:
    """Whether a lens explains pictures left out better, summed picture by picture, whose noise differs."""
    errors = [validation.errors_px / validation.spreads for validation in (one, other)]
    scale = _TAIL * min(float(np.median(e)) for e in errors)
    gains = np.log1p((errors[1] / scale) ** 2) - np.log1p((errors[0] / scale) ** 2)
    by_picture = np.bincount(one.pictures, gains)
    chance = float(by_picture.std(ddof=1)) * np.sqrt(len(by_picture))
    return bool(by_picture.sum() > _BEYOND_CHANCE * chance)


def _find(
    pictures: Sequence[LensPicture], board: LensBoard, camera: CameraModel | None, step: str, progress: Progress
) -> list[BoardSight]:
    def look(picture: LensPicture) -> BoardSight | None:
        return find_board(picture.grey, picture.name, board, camera)

    found = []
    with progress.step(step, len(pictures)) as advance:
        for sight in in_parallel(look, pictures, os.cpu_count() or 1):
            advance()
            if sight is not None:
                found.append(sight)
    return found


def _named(pictures: Sequence[LensPicture], sights: Sequence[BoardSight]) -> list[LensPicture]:
    names = {sight.name for sight in sights}
    return [picture for picture in pictures if picture.name in names]


def _require(sights: Sequence[BoardSight], pictures: Sequence[LensPicture], board: LensBoard) -> None:
    if len(sights) < _LEAST_SIGHTS:
        raise LensError(
            f"{board.name}: {len(sights)} of {len(pictures)} pictures show this board; 8 or more are needed. Is it the "
            "board's own file? Film it from near by, still, in bright light, with all of it in the picture"
        )
