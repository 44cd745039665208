"""Points from rays: where they meet, how far they miss, and how far apart they are."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.mapping.triangulation import triangulate

FOCAL = 240.0
Array = NDArray[np.float64]


def rays(centres: Array, directions: Array) -> tuple[Array, Array, Array]:
    return centres, directions / np.linalg.norm(directions, axis=2, keepdims=True), np.full(centres.shape[:2], FOCAL)


def scene(count: int, views: int, seed: int = 0) -> tuple[Array, Array]:
    """Points (P, 3), and for each the places (P, V, 3) that it is seen from."""
    random = np.random.default_rng(seed)
    return random.uniform(-2.0, 2.0, (count, 3)) + [0.0, 0.0, 5.0], random.uniform(-1.0, 1.0, (count, views, 3))


@pytest.mark.parametrize("views", [2, 3, 8])
def test_exact_rays_give_the_point(views: int) -> None:
    points, centres = scene(50, views)
    found = triangulate(*rays(centres, points[:, None] - centres))
    np.testing.assert_allclose(found.points, points, atol=1e-5)
    assert found.errors_px.max() < 1e-3
    towards = points[:, None] - centres
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    widest = np.arccos(np.clip(np.einsum("pvi,pwi->pvw", towards, towards), -1, 1)).max(axis=(1, 2))
    np.testing.assert_allclose(found.angles, widest, atol=1e-5)


def test_agrees_with_opencv_where_pixels_err() -> None:
    """Narrow perspective cameras, whose pixels are angles: linear triangulation is as near to the truth, not nearer."""
    random = np.random.default_rng(2)
    points = random.uniform(-0.5, 0.5, (300, 3)) + [0.0, 0.0, 6.0]
    places = np.array([[-0.8, 0.0, 0.0], [0.8, 0.1, 0.0]])
    k = np.diag([2000.0, 2000.0, 1.0])
    pixels, directions = [], []
    for place in places:
        seen = points - place
        xy = 2000.0 * seen[:, :2] / seen[:, 2:] + 0.5 * random.normal(size=(300, 2))
        pixels.append(xy)
        directions.append(np.column_stack([xy / 2000.0, np.ones(300)]))
    matrices = [k @ np.column_stack([np.eye(3), -place]) for place in places]
    homogeneous = cv2.triangulatePoints(matrices[0], matrices[1], pixels[0].T, pixels[1].T)
    independent = (homogeneous[:3] / homogeneous[3]).T
    found = triangulate(*rays(np.tile(places, (300, 1, 1)), np.stack(directions, axis=1)))
    errors = [np.linalg.norm(ours - points, axis=1).mean() for ours in (found.points, independent)]
    np.testing.assert_allclose(found.points, independent, atol=0.01 * 0.05)
    assert errors[0] < 1.01 * errors[1]
