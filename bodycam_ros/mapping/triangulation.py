"""Points from rays of known cameras, and rays from directions far from each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ITERATIONS = 3  # weights are distances, and settle in two
_MIN_DISTANCE_M = 0.05
_REGULARISATION = 1e-12  # of the normal matrix: rays may be parallel


@dataclass(frozen=True)
class Triangulation:
    """P points.

    Attributes:
        points: (P, 3).
        errors_px: (P, V) reprojection errors; zero for padding, infinite behind a camera.
        angles: (P,) the widest between two rays [rad].
    """

    points: Array
    errors_px: Array
    angles: Array


def triangulate(centres: Array, directions: Array, focal_px: Array) -> Triangulation:
    """Points that minimise the squared angles to their rays, weighted by the focal length.

    The squared distance of x to a ray from c along d is |(I - d d^T)(x - c)|^2; over the squared distance from c it is
    an angle.

    Args:
        centres: (P, V, 3) origins of the rays.
        directions: (P, V, 3) unit.
        focal_px: (P, V) pixels per radian of the cameras; 0 marks padding.
    """
    across = np.eye(3) - directions[..., :, None] * directions[..., None, :]
    there = focal_px > 0.0
    weights = focal_px**2
    # From the middle of the cameras: far from the origin digits would be lost.
    middle = np.einsum("pv,pvi->pi", there, centres) / there.sum(axis=1)[:, None]
    centres = centres - middle[:, None]
    for _ in range(_ITERATIONS):
        normal = np.einsum("pv,pvij->pij", weights, across)
        right = np.einsum("pv,pvij,pvj->pi", weights, across, centres)
        scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        points = np.linalg.solve(normal + _REGULARISATION * scale * np.eye(3), right[:, :, None])[:, :, 0]
        offsets = points[:, None] - centres
        distances = np.maximum(np.linalg.norm(offsets, axis=2), _MIN_DISTANCE_M)
        weights = (focal_px / distances) ** 2
    towards = offsets / distances[:, :, None]
    sines = np.linalg.norm(np.cross(directions, towards), axis=2)
    behind = there & (np.einsum("pvi,pvi->pv", directions, towards) <= 0.0)
    cosines = np.einsum("pvi,pwi->pvw", towards, towards)
    narrowest = np.where(there[:, :, None] & there[:, None, :], cosines, 1.0).min(axis=(1, 2))
    return Triangulation(
        points + middle, np.where(behind, np.inf, focal_px * sines), np.arccos(np.clip(narrowest, -1.0, 1.0))
    )


def spread_directions(directions: Array, count: int) -> NDArray[np.int64]:
    """Rows of up to ``count`` unit directions (N, 3): the first, then each the farthest from those before it."""
    chosen = [0]
    cosines = directions @ directions[0]
    while len(chosen) < min(count, len(directions)):
        following = int(cosines.argmin())
        chosen.append(following)
        cosines = np.maximum(cosines, directions @ directions[following])
        cosines[chosen] = np.inf
    return np.array(chosen, dtype=np.int64)
