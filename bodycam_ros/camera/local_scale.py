"""How a lens shows what lies at an angle to its axis, in tables: kernels look them up, since a root costs more."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.model import CameraModel

_SAMPLES = 129  # between two of them the scale of a fisheye changes by 3 % at most
_FINE_SAMPLES = 1025  # between two of them the pixel of a fisheye is linear to 1e-3 px
_INSIDE = 1e-3  # [rad] from the rim, where the lens model ends


def local_scales(camera: CameraModel) -> NDArray[np.float64]:
    """(N,) pixels per radian, the geometric mean of all directions, at N cosines of the angle to the axis from -1 to 1.

    Beyond what the lens shows, it is as at the rim. Tangential distortion is taken as it is in the image's row.
    """
    widest = max(0.0, camera.max_angle - _INSIDE)
    angles = np.minimum(np.arccos(np.linspace(-1.0, 1.0, _SAMPLES)), widest)
    cos = np.cos(angles)
    sin = np.sin(angles)
    zero = np.zeros(_SAMPLES)
    one = np.ones(_SAMPLES)
    jacobian = camera.project_with_jacobian(np.column_stack([sin, zero, cos]))[1]
    across = np.stack([np.column_stack([cos, zero, -sin]), np.column_stack([zero, one, zero])], axis=-1)
    scales: NDArray[np.float64] = np.sqrt(np.abs(np.linalg.det(jacobian @ across)))
    return scales


def radial_gains(camera: CameraModel) -> NDArray[np.float64]:
    """(N,) distorted radius over the sine of the angle to the axis, at N cosines of it from -1 to 1.

    NaN beyond what the lens shows; without tangential distortion.
    """
    cosines = np.linspace(-1.0, 1.0, _FINE_SAMPLES)
    sines = np.sqrt(np.maximum(1.0 - cosines**2, 1e-12))
    pixels, valid = camera.project(np.column_stack([sines, np.zeros(_FINE_SAMPLES), cosines]))
    return np.where(valid, (pixels[:, 0] - camera.cx) / (camera.fx * sines), np.nan)


def scales_at(camera: CameraModel, cosines: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N,) pixels per radian at the cosines (N,) of angles to the axis."""
    return np.asarray(np.interp(cosines, *_table(camera)), np.float64)


@lru_cache(maxsize=64)
def _table(camera: CameraModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.linspace(-1.0, 1.0, _SAMPLES), local_scales(camera)
