"""Against round cones as they are known exactly: the union of all balls between two."""

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from bodycam_ros.outside.limb_mesh import Ball, limb_mesh
from bodycam_ros.outside.surface import Surface

START, END = np.array([0.02, -0.05, 0.1]), np.array([0.1, 0.06, -0.3])
ACROSS = np.array([0.0, 1.0, 0.0])


def distance(points: NDArray[np.float64], wide: float, narrow: float) -> NDArray[np.float64]:
    """(N) signed distances from the round cone around START and END [m]."""
    along = np.linspace(0.0, 1.0, 2001)
    centres, radii = START + along[:, None] * (END - START), wide + along * (narrow - wide)
    return (np.linalg.norm(points[:, None] - centres, axis=2) - radii).min(axis=1)


@pytest.mark.parametrize(("wide", "narrow"), [(0.09, 0.06), (0.05, 0.05), (0.03, 0.08)])
def test_the_contour_of_a_tapered_capsule(wide: float, narrow: float) -> None:
    """A ray through a contour point touches the round cone: on average it neither misses nor enters it."""
    surface = Surface("limb", *limb_mesh(START, END, [Ball(0.0, wide), Ball(1.0, narrow)], ACROSS))
    misses, lengths = [], []
    for camera in (np.array([2.0, 0.3, 0.0]), np.array([-1.0, 1.5, 0.8]), np.array([0.4, -2.0, 0.3])):
        start, end = surface.vertices[surface.edges[surface.contour(camera)].T]
        middles = 0.5 * (start + end)
        rays = (middles - camera) / np.linalg.norm(middles - camera, axis=1, keepdims=True)
        near = middles[:, None] + np.linspace(-0.05, 0.05, 41)[:, None] * rays[:, None]
        misses.append(distance(near.reshape(-1, 3), wide, narrow).reshape(len(near), -1).min(axis=1))
        lengths.append(np.linalg.norm(end - start, axis=1))
    miss, length = np.concatenate(misses), np.concatenate(lengths)
    assert np.abs(miss).max() < 0.015 * max(wide, narrow)
    assert abs(np.average(miss, weights=length)) < 0.004 * max(wide, narrow)


def test_over_all_directions_it_is_as_wide_as_the_limb() -> None:
    vertices, _ = limb_mesh(START, END, [Ball(0.0, 0.07), Ball(1.0, 0.07)], ACROSS)
    axis = (END - START) / np.linalg.norm(END - START)
    across = np.cross(axis, ACROSS) / np.linalg.norm(np.cross(axis, ACROSS))
    angles = np.linspace(0.0, np.pi, 1000, endpoint=False)
    directions = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(axis, across)
    widths = np.ptp(vertices @ directions.T, axis=0)
    assert widths.mean() == pytest.approx(0.14, rel=1e-4)
    assert np.ptp(widths) / 0.14 < 0.01


def test_it_is_closed_and_has_the_volume_of_a_capsule() -> None:
    length, radius = float(np.linalg.norm(END - START)), 0.05
    mesh = trimesh.Trimesh(*limb_mesh(START, END, [Ball(0.0, radius), Ball(1.0, radius)], ACROSS), process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(np.pi * radius**2 * length + 4.0 / 3.0 * np.pi * radius**3, rel=0.01)


def test_a_limb_that_is_not_round_is_broad_across() -> None:
    vertices, _ = limb_mesh(np.zeros(3), np.array([0.0, 0.0, 0.4]), [Ball(0.0, 0.1, 1.5), Ball(1.0, 0.1, 1.0)], ACROSS)
    low = vertices[np.abs(vertices[:, 2]) < 0.03]
    np.testing.assert_allclose(np.ptp(low, axis=0)[:2], [0.2, 0.3], rtol=0.02)
    high = vertices[np.abs(vertices[:, 2] - 0.4) < 0.03]
    np.testing.assert_allclose(np.ptp(high, axis=0)[:2], [0.2, 0.2], rtol=0.05)


def test_a_ball_within_another_changes_nothing() -> None:
    one = trimesh.Trimesh(*limb_mesh(START, END, [Ball(0.0, 0.2)], ACROSS), process=False)
    two = trimesh.Trimesh(*limb_mesh(START, END, [Ball(0.0, 0.2), Ball(0.1, 0.02)], ACROSS), process=False)
    assert two.is_watertight
    np.testing.assert_allclose(two.bounds, one.bounds, atol=1e-9)
