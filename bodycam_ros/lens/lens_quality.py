"""How far a fitted lens is to be trusted, by pictures that were left out of the fit, and what to film to mend it."""

from dataclasses import dataclass
from itertools import compress

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, nearest_rotation
from bodycam_ros.lens.lens_fit import LensFit, fit_lens, lens_numbers

TRUSTED_RADIUS = 0.9
"""Share of the image radius, up to which rays should be right."""

CELLS = (6, 8)
"""Rows and columns that a picture is divided into."""

_GRID = (25, 33)
_FOLDS, _FOLD_ROUNDS = 5, 2  # rounds of weights; they start from the whole fit
_REACHED = 99.5  # percentile of the points' distances from the centre
_DIRECTIONS = 4  # that the board's face may be turned to, beside straight at the camera
_TILTED = np.sin(np.radians(15.0))
_LIT_SHARE, _LEAST_POINTS = 0.5, 2  # of a cell that the lens shows; points in a cell that is covered

_MAX_ERROR_PX = 1.0  # median of pictures left out; more is a wrong model or board
_MAX_RAY_ERROR_PX, _REFUSED_RAY_PX = 1.0, 5.0  # by how much lenses of fewer pictures differ where the board was seen
_MAX_CORNER_ERROR_PX = 5.0  # the same in the corners, which no board was seen in
_MIN_PICTURES, _MIN_COVERAGE, _MIN_TILTS = 8, 0.5, 3
_MIN_REACH, _MIN_REACH_WHOLE = 0.8, 0.6  # of the image radius; of a board that must be whole in the picture


@dataclass(frozen=True)
class ValidatedLens:
    """A lens, and the errors of pictures that were left out of its fit.

    Attributes:
        fit: the lens.
        errors_px: (N,) of all points of the fit, each by the lens that was fitted without its picture, where that
            places it.
        ray_errors_px: (G,) expected error of the ray of each pixel of the grid; infinite where the lens has none.
        corner_errors_px: (C,) the same of pixels beyond the grid, out to the corners.
        lens_sigma: standard deviations of fx, fy, cx, cy [px] and the distortion.
    """

    fit: LensFit
    errors_px: Array
    ray_errors_px: Array
    corner_errors_px: Array
    lens_sigma: Array

    @property
    def model(self) -> str:
        """Name of the camera model."""
        return self.fit.camera.distortion_model

    @property
    def median_px(self) -> float:
        """Median error of the points left out [px]."""
        return float(np.median(self.errors_px))

    @property
    def worst_ray_px(self) -> float:
        """Largest expected error of a ray of the grid [px]."""
        return float(self.ray_errors_px.max())

    @property
    def corner_px(self) -> float:
        """Largest expected error of a ray in the corners [px]."""
        return float(self.corner_errors_px.max(initial=0.0))


@dataclass(frozen=True)
class BoardCoverage:
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


def validate(fit: LensFit, grid: Array, corners: Array) -> ValidatedLens:
    """Fit again without each fifth of the pictures, and measure the errors of those with that lens.

    The lenses of four fifths differ from the whole's by as much as that is off (delete-d jackknife). A rotation of the
    camera is taken out: that is a part of where the camera is mounted.

    Args:
        fit: the whole.
        grid: (G, 2) pixels at which rays are compared.
        corners: (C, 2) pixels beyond, at which they are compared too.
    """
    folds = min(_FOLDS, len(fit.views))
    errors_px = np.empty(len(fit.rows))
    squares, lens_squares = np.zeros(len(grid) + len(corners)), np.zeros(len(lens_numbers(fit.camera)))
    for fold in range(folds):
        is_out = np.arange(len(fit.views)) % folds == fold
        used, left_out = (list(compress(fit.views, rows)) for rows in (~is_out, is_out))
        part = fit_lens(fit.camera, used, fit.poses[~is_out], rounds=_FOLD_ROUNDS)
        test = fit_lens(part.camera, left_out, fit.poses[is_out], True, _FOLD_ROUNDS)
        errors_px[is_out[fit.rows]] = test.errors_px
        squares += ray_difference_px(fit.camera, part.camera, grid, corners) ** 2
        lens_squares += (lens_numbers(part.camera) - lens_numbers(fit.camera)) ** 2
    share = (folds - 1) / folds
    rays_px, corners_px = np.split(np.sqrt(share * squares), [len(grid)])
    return ValidatedLens(fit, errors_px, rays_px, corners_px, np.sqrt(share * lens_squares))


def ray_difference_px(camera: CameraModel, other: CameraModel, grid: Array, beyond: Array | None = None) -> Array:
    """(G + C,) by how many pixels two lenses differ, once one is turned to fit the other at pixels (G, 2) of a grid.

    Infinite where one of them has no ray. The last C are pixels (C, 2) beyond the grid.
    """
    pixels = grid if beyond is None else np.concatenate([grid, beyond])
    rays, valid = camera.unproject(pixels)
    others, other_valid = other.unproject(pixels)
    both = valid & other_valid
    within = both & (np.arange(len(pixels)) < len(grid))
    difference = np.full(len(pixels), np.inf)
    if within.sum() < 3:
        return difference
    camera_R_other = nearest_rotation(rays[within].T @ others[within])
    seen, in_view = camera.project(others[both] @ camera_R_other.T)
    difference[both] = np.where(in_view, np.linalg.norm(seen - pixels[both], axis=1), np.inf)
    return difference


def image_radius(is_lit: NDArray[np.bool_]) -> float:
    """Distance of the outermost lit pixels from the centre of the picture (H, W) [px]."""
    height, width = is_lit.shape
    down, across = np.nonzero(is_lit)
    distances = np.hypot(across - 0.5 * (width - 1), down - 0.5 * (height - 1))
    return float(np.percentile(distances, 99.9)) if len(distances) else 0.0


def ray_grid(is_lit: NDArray[np.bool_], share: float = TRUSTED_RADIUS, beyond: float = -1.0) -> Array:
    """Lit pixels (G, 2) up to a share of the image radius, and beyond another."""
    height, width = is_lit.shape
    rows, columns = np.linspace(0, height - 1, _GRID[0]), np.linspace(0, width - 1, _GRID[1])
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    at = grid.round().astype(int)
    distances = np.linalg.norm(grid - 0.5 * np.array([width - 1, height - 1]), axis=1)
    radius = image_radius(is_lit)
    is_inside = (distances <= share * radius) & (distances > beyond * radius)
    inside: Array = grid[is_lit[at[:, 1], at[:, 0]] & is_inside]
    return inside


def board_coverage(fit: LensFit, is_lit: NDArray[np.bool_]) -> BoardCoverage:
    """Where the board was seen, in a picture of which some pixels (H, W) are lit."""
    height, width = is_lit.shape
    share = np.asarray(cv2.resize(is_lit.astype(np.float32), CELLS[::-1], interpolation=cv2.INTER_AREA))
    points = np.histogram2d(fit.pixels[:, 1], fit.pixels[:, 0], CELLS, ((-0.5, height - 0.5), (-0.5, width - 0.5)))[0]
    radius = image_radius(is_lit)
    distances = np.linalg.norm(fit.pixels - 0.5 * np.array([width - 1, height - 1]), axis=1)
    return BoardCoverage(
        is_lit=share >= _LIT_SHARE,
        is_covered=points >= _LEAST_POINTS,
        radius_px=radius,
        reach=min(1.0, float(np.percentile(distances, _REACHED)) / radius),
        tilts=len(np.unique(_ways_turned(fit.poses))),
    )


def objections(lens: ValidatedLens) -> list[str]:
    """Why the lens must not be used, each with what to do; none if it may."""
    found = []
    if lens.median_px > _MAX_ERROR_PX:
        found.append(
            f"the error in the test pictures is {lens.median_px:.2f} px (median), more than {_MAX_ERROR_PX:g} px: no "
            "lens of this --model fits these pictures; try another --model, check that the board is flat and its file "
            "right, and hold the board still"
        )
    if not lens.worst_ray_px <= _REFUSED_RAY_PX:
        found.append(
            "lenses of fewer pictures differ too much where the board was seen "
            f"({_pixels(lens.worst_ray_px)}, more than {_REFUSED_RAY_PX:g} px): film the board larger and "
            "tilted, in more places; or take a --model with fewer coefficients"
        )
    return found


def warnings(lens: ValidatedLens, area: BoardCoverage, must_be_whole: bool) -> list[str]:
    """What makes the lens less certain than it could be, each with what to film.

    Args:
        lens: the lens.
        area: where the board was seen.
        must_be_whole: a checkerboard, which is found only where all of it is in the picture.
    """
    found = []
    if len(lens.fit.views) < _MIN_PICTURES:
        found.append(
            f"{len(lens.fit.views)} sharp pictures show the board; take {_MIN_PICTURES} or more, the board still while "
            "the camera looks, in bright light"
        )
    if area.coverage < _MIN_COVERAGE:
        found.append(
            f"the board was seen in {area.coverage:.0%} of the picture, less than {_MIN_COVERAGE:.0%}; bring it to the "
            "cells that are red in the picture of the calibration"
        )
    if area.reach < (_MIN_REACH_WHOLE if must_be_whole else _MIN_REACH):
        how = "whole, as near to the corners as it goes" if must_be_whole else "close by, cut off by the border"
        found.append(
            f"the board was seen only out to {area.reach:.0%} of the image radius, and the lens is unknown beyond it; "
            f"show the board in the corners, {how}"
        )
    if area.tilts < _MIN_TILTS:
        found.append(
            f"the board was turned in {area.tilts} ways only, less than {_MIN_TILTS}, so focal length and distance are "
            "hard to separate; tilt it by 30 to 45 deg to the left, the right, up and down, and turn it in its plane"
        )
    if lens.worst_ray_px > _MAX_RAY_ERROR_PX:
        found.append(
            f"rays where the board was seen are uncertain by up to {_pixels(lens.worst_ray_px)}, more than "
            f"{_MAX_RAY_ERROR_PX:g} px; film the board larger, nearer, tilted, and in the corners"
        )
    if lens.corner_px > max(_MAX_CORNER_ERROR_PX, lens.worst_ray_px):
        found.append(
            "rays in the corners, where no board was seen, are uncertain "
            f"({_pixels(lens.corner_px)}, more than {_MAX_CORNER_ERROR_PX:g} px); film the board there, or do not use "
            "the corners"
        )
    return found


def _pixels(error_px: float) -> str:
    return f"{error_px:.1f} px" if np.isfinite(error_px) else "some have no ray"


def _ways_turned(poses: Array) -> NDArray[np.int64]:
    """(V,) 0 where the board faces the camera, by poses (V, 4, 4), else the number of the way it is turned."""
    towards = poses[:, :3, 3] / np.linalg.norm(poses[:, :3, 3], axis=1, keepdims=True)
    faces = poses[:, :3, 2]
    across = faces - np.sum(faces * towards, axis=1, keepdims=True) * towards
    way = np.floor((np.arctan2(across[:, 1], across[:, 0]) + np.pi) / (2.0 * np.pi) * _DIRECTIONS).astype(np.int64)
    return np.where(np.linalg.norm(across, axis=1) < _TILTED, 0, 1 + np.clip(way, 0, _DIRECTIONS - 1))
