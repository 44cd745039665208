"""Whether a lens is the one that a recording was made with: the epipolar error of the recording's own points tells.

Two pictures that a camera took while it turned and went on fit together by a turn and a direction alone, if the rays of
their points are right. With the lens of another mode (linear in place of wide, a crop for stabilisation)
they fit less well than with rays that lie closer together or farther apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.lens.lens_fit import lens_numbers, with_lens
from bodycam_ros.tracking.rotation import estimate_rotation

PointPair = tuple[Array, Array]
"""Pixels (N, 2) of the same points in two pictures of a camera."""

SCALES = np.geomspace(0.5, 2.0, 25)
"""By which the focal lengths are tried to be larger; 1 is the thirteenth."""

_LEAST_PAIRS = 4
_LEAST_POINTS = 30
_LEAST_SHARE = 0.8  # of a pair's points that a lens must see
_LEAST_TURN_DEG = 4.0  # between two pictures; translation alone does not show a lens
_MISMATCH = 1.06  # of the focal length, or its inverse: no lens mode differs by less
_CLEAR_SHARE = 0.75  # of the error with the given lens, which another lens must reach
_CLEAR_PAIRS = 0.75  # of the pairs that must agree
_INLIER_ANGLE_DEG, _HYPOTHESES = 2.0, 64
_SPREADS_PX = np.geomspace(10.0, 0.7, 16)
"""Of points about their lines, step by step: what is on the wearer must not decide at first."""

_DIRECTION_STEPS = 6
_TINY = 1e-12


@dataclass(frozen=True)
class LensMatch:
    """A lens compared with a recording's points.

    Attributes:
        camera: its name.
        scale: by which the focal lengths should be larger; 1 where nothing contradicts the lens.
        error_px: median epipolar error with the lens as it is given [px].
        best_px: the same at ``scale`` [px].
        pairs: of pictures that were compared; of fewer than four nothing is concluded.
    """

    camera: str
    scale: float
    error_px: float
    best_px: float
    pairs: int

    @property
    def matches(self) -> bool:
        """Whether nothing contradicts the lens."""
        return self.scale == 1.0

    @property
    def is_known(self) -> bool:
        """Whether there were enough pairs."""
        return self.pairs >= _LEAST_PAIRS

    @property
    def text(self) -> str:
        """For a person."""
        if self.matches:
            return f"camera {self.camera}: its lens fits its pictures ({self.error_px:.1f} px off)"
        return (
            f"camera {self.camera}: images do not fit its calibration (camera_info): points are "
            f"{self.error_px:.1f} px off their epipolar lines, {self.best_px:.1f} px if focal lengths were "
            f"{self.scale:.2f} times as long, "
            f"{_mode(self.scale)}. Measure the lens in the mode that was recorded in (bodycam lens), "
            "or record in the lens' mode"
        )


def lens_match(camera: CameraModel, pairs: Sequence[PointPair]) -> LensMatch:
    """Compare a lens with pairs of pictures.

    Args:
        camera: as the recording has it.
        pairs: points of pictures, some tenths of a second apart; those between which it hardly turned are left out.
    """
    return judge_lens(
        camera,
        [[epipolar_error(camera, scale, pair) for scale in SCALES] for pair in pairs if shows_lens(camera, pair)],
    )


def shows_lens(camera: CameraModel, pair: PointPair) -> bool:
    """Whether the camera turned far enough between two pictures for them to show its lens."""
    return _turn_deg(camera, pair) >= _LEAST_TURN_DEG


def epipolar_error(camera: CameraModel, scale: float, pair: PointPair) -> float:
    """Median epipolar error of a pair [px] with focal lengths that are so many times as long; infinite if none fits."""
    return _epipolar_error(_scaled(camera, scale), pair)


def judge_lens(camera: CameraModel, errors_pairs: Sequence[Sequence[float]]) -> LensMatch:
    """The lens that errors of pairs show.

    Args:
        camera: as the recording has it.
        errors_pairs: (pairs, SCALES) of ``epipolar_error``, of pairs that show the lens.
    """
    if len(errors_pairs) < _LEAST_PAIRS:
        return LensMatch(camera.name, 1.0, 0.0, 0.0, len(errors_pairs))
    errors = np.array(errors_pairs)
    whole = np.median(errors, axis=0)
    given, best = len(SCALES) // 2, int(np.argmin(whole))
    if not np.isfinite(whole[given]):
        return LensMatch(camera.name, 1.0, 0.0, 0.0, 0)
    scale = float(SCALES[best])
    gains = np.mean(errors[:, best] < errors[:, given])
    clear = whole[best] < _CLEAR_SHARE * whole[given] and gains >= _CLEAR_PAIRS
    if not clear or 1.0 / _MISMATCH < scale < _MISMATCH:
        scale, best = 1.0, given
    return LensMatch(camera.name, scale, float(whole[given]), float(whole[best]), len(errors_pairs))


def _mode(scale: float) -> str:
    """The lens mode that is likely."""
    if scale > 1.0:
        if scale < 1.22:
            return "so it shows less, as with stabilisation on (a crop by a tenth)"
        if scale < 1.55:
            return "so it shows less, as in the mode 'linear' in place of 'wide', or with strong stabilisation"
        return "so it shows much less, as in the mode 'narrow' or with digital zoom"
    if scale > 0.82:
        return "so it shows more, as with stabilisation off where the lens was measured with it on"
    if scale > 0.65:
        return "so it shows more, as in the mode 'wide' where the lens was measured in 'linear'"
    return "so it shows much more, as in the mode 'wide' where the lens was measured in 'narrow' or with zoom"


def _scaled(camera: CameraModel, scale: float) -> CameraModel:
    lens = lens_numbers(camera)
    lens[:2] *= scale
    return with_lens(camera, lens)


def _rays(camera: CameraModel, pair: PointPair) -> tuple[Array, Array]:
    first, first_valid = camera.unproject(pair[0])
    second, second_valid = camera.unproject(pair[1])
    both = first_valid & second_valid
    return first[both], second[both]


def _turn_deg(camera: CameraModel, pair: PointPair) -> float:
    first, second = _rays(camera, pair)
    if len(first) < _LEAST_POINTS:
        return 0.0
    turn, agree = estimate_rotation(first, second, 0, _INLIER_ANGLE_DEG, _HYPOTHESES)
    return float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0)))) if agree.any() else 0.0


def _epipolar_error(camera: CameraModel, pair: PointPair) -> float:
    """Median distance of points from their epipolar lines [px], by the best turn and direction; infinite if none."""
    first, second = _rays(camera, pair)
    if len(first) < _LEAST_SHARE * len(pair[0]) or len(first) < _LEAST_POINTS:
        return np.inf
    turn, agree = estimate_rotation(first, second, 0, _INLIER_ANGLE_DEG, _HYPOTHESES)
    if not agree.any():
        return np.inf
    focal = 0.5 * (camera.fx + camera.fy)
    weights = np.ones(len(first))
    direction = np.zeros(3)
    for step, spread in enumerate(_SPREADS_PX):
        turned = first @ turn.T
        normals = np.cross(turned, second)
        if step < _DIRECTION_STEPS:  # from then on it is about right, and refined together with the turn
            _, vectors = np.linalg.eigh((normals * weights[:, None]).T @ normals)
            direction = vectors[:, 0]
        along = turned @ direction
        reach = np.sqrt(np.maximum(1.0 - along**2, _TINY))
        errors = normals @ direction / reach * focal
        weights = 1.0 / (1.0 + (errors / spread) ** 2) ** 2
        across = np.linalg.svd(direction[None])[2][1:]
        by_turn = along[:, None] * second - np.sum(turned * second, axis=1, keepdims=True) * direction
        slopes = np.concatenate([by_turn, normals @ across.T], axis=1) / reach[:, None] * focal
        system = (slopes * weights[:, None]).T @ slopes
        system += 1e-6 * np.trace(system) * np.eye(5)
        change = -np.linalg.solve(system, (slopes * weights[:, None]).T @ errors)
        turn = exp_so3(np.asarray(change[:3], np.float64)) @ turn
        direction = direction + change[3:] @ across
        direction /= np.linalg.norm(direction)
    return float(np.median(np.abs(errors)))
