"""Points from the rays of registered cameras, and what A 4.1 asks of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 3  # the weights, which are distances, settle in two
_LEAST_DISTANCE_M = 0.05
_NEARLY_PARALLEL = 1e-12


@dataclass(frozen=True)
class Rays:
    """Rays to P points, up to V each; the others are padding.

    Attributes:
        centres: (P, V, 3) where they start [m].
        directions: (P, V, 3) unit, in the world.
        focal_lengths: (P, V) pixels per radian of the cameras [px].
        there: (P, V) which are no padding.
    """

    centres: Array
    directions: Array
    focal_lengths: Array
    there: NDArray[np.bool_]


@dataclass(frozen=True)
class Triangulated:
    """P points.

    Attributes:
        points: (P, 3) [m].
        errors_px: (P, V) reprojection errors; zero for padding, infinite behind a camera.
        angles: (P,) the widest between two rays [rad].
    """

    points: Array
    errors_px: Array
    angles: Array


def triangulate(rays: Rays) -> Triangulated:
    """The points that are nearest to their rays in angle.

    The squared distance of x to a ray from c along d is |(I - d d^T)(x - c)|^2; over the squared distance from c it is
    an angle.
    """
    across = np.eye(3) - rays.directions[..., :, None] * rays.directions[..., None, :]
    weights = rays.there * rays.focal_lengths**2
    # From the middle of the cameras, or digits would be lost far from the origin.
    middle = np.einsum("pv,pvi->pi", rays.there, rays.centres) / rays.there.sum(axis=1)[:, None]
    centres = rays.centres - middle[:, None]
    for _ in range(_ROUNDS):
        normal = np.einsum("pv,pvij->pij", weights, across)
        right = np.einsum("pv,pvij,pvj->pi", weights, across, centres)
        scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        points = np.linalg.solve(normal + _NEARLY_PARALLEL * scale * np.eye(3), right[:, :, None])[:, :, 0]
        offsets = points[:, None] - centres
        distances = np.maximum(np.linalg.norm(offsets, axis=2), _LEAST_DISTANCE_M)
        weights = rays.there * (rays.focal_lengths / distances) ** 2
    towards = offsets / distances[:, :, None]
    sines = np.linalg.norm(np.cross(rays.directions, towards), axis=2)
    before = np.einsum("pvi,pvi->pv", rays.directions, towards) > 0.0
    errors = np.where(before, rays.focal_lengths * sines, np.inf)
    cosines = np.einsum("pvi,pwi->pvw", towards, towards)
    both = rays.there[:, :, None] & rays.there[:, None, :]
    narrowest = np.where(both, cosines, 1.0).min(axis=(1, 2))
    return Triangulated(points + middle, np.where(rays.there, errors, 0.0), np.arccos(np.clip(narrowest, -1.0, 1.0)))
