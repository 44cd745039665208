"""How far a fitted lens is to be trusted: by pictures that were left out of the fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, nearest_rotation
from bodycam_ros.lens.lens_fit import LensFit, fit_lens

_FOLDS = 5
_FOLD_ROUNDS = 2  # of weights; they start from the whole fit


@dataclass(frozen=True)
class Validation:
    """What pictures that were left out say.

    Attributes:
        errors_px: (N,) of all points, each by the lens that was fitted without its picture, where the picture was
            placed by that lens.
        pixels, spreads, pictures: (N, 2) of them, (N,) how uncertain they are, and (N,) the picture of each.
        ray_errors_px: (G,) by how much the ray of each pixel of the grid is expected to be off; infinite where the lens
            has none.
    """

    errors_px: Array
    pixels: Array
    spreads: Array
    pictures: NDArray[np.int64]
    ray_errors_px: Array

    @property
    def median_px(self) -> float:
        """Median error of the points left out [px]."""
        return float(np.median(self.errors_px))

    @property
    def worst_ray_px(self) -> float:
        """Largest expected error of a ray of the grid [px]."""
        return float(self.ray_errors_px.max())


def validate(fit: LensFit, grid: Array) -> Validation:
    """Fit again without each fifth of the pictures, and look at those with that lens.

    The lenses of four fifths differ from the whole's by as much as that is off (delete-d jackknife). What a turn of the
    camera makes up for is taken out: that is a part of where the camera is mounted.

    Args:
        fit: the whole.
        grid: (G, 2) pixels at which rays are compared.
    """
    pictures = np.arange(len(fit.sights))
    folds = min(_FOLDS, len(pictures))
    tests, rows = [], []
    squares = np.zeros(len(grid))
    for fold in range(folds):
        left_out = pictures[pictures % folds == fold]
        used = np.setdiff1d(pictures, left_out)
        part = fit_lens(fit.camera, [fit.sights[row] for row in used], fit.poses[used], rounds=_FOLD_ROUNDS)
        test = fit_lens(part.camera, [fit.sights[row] for row in left_out], fit.poses[left_out], True, _FOLD_ROUNDS)
        tests.append(test)
        rows.append(left_out[test.rows])
        squares += ray_difference_px(fit.camera, part.camera, grid) ** 2
    ray_errors = np.sqrt((folds - 1) / folds * squares)
    return Validation(
        errors_px=np.concatenate([test.errors_px for test in tests]),
        pixels=np.concatenate([test.pixels for test in tests]),
        spreads=np.concatenate([test.spreads for test in tests]),
        pictures=np.concatenate(rows),
        ray_errors_px=ray_errors,
    )


def ray_difference_px(camera: CameraModel, other: CameraModel, grid: Array) -> Array:
    """(G,) by how many pixels two lenses differ at the pixels (G, 2) of a grid, once one is turned to fit the other.

    Infinite where one of them has no ray.
    """
    rays, valid = camera.unproject(grid)
    others, other_valid = other.unproject(grid)
    both = valid & other_valid
    difference = np.full(len(grid), np.inf)
    if both.sum() < 3:
        return difference
    camera_R_other = nearest_rotation(rays[both].T @ others[both])
    seen, in_view = camera.project(others[both] @ camera_R_other.T)
    difference[both] = np.where(in_view, np.linalg.norm(seen - grid[both], axis=1), np.inf)
    return difference
