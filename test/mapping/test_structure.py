import numpy as np
import pytest
from small_structure import small_structure

from bodycam_ros.geometry import exp_so3


def test_exact_observations_reproject_exactly():
    structure = small_structure()
    assert structure.reprojection_errors().max() < 1e-9


def test_a_similarity_leaves_the_images_as_they_are():
    structure = small_structure()
    R, t = exp_so3(np.array([0.3, -1.0, 2.0])), np.array([4.0, 5.0, -6.0])
    moved = structure.transformed(2.5, R, t)
    assert moved.reprojection_errors().max() < 1e-9
    assert moved.points_world[3] == pytest.approx(2.5 * R @ structure.points_world[3] + t)
    gap = np.linalg.norm(moved.world_T_camera[0, :3, 3] - moved.world_T_camera[1, :3, 3])
    assert gap == pytest.approx(
        2.5 * np.linalg.norm(structure.world_T_camera[0, :3, 3] - structure.world_T_camera[1, :3, 3])
    )


def test_dropping_points_keeps_the_other_observations_on_their_points():
    structure = small_structure()
    kept = structure.with_points(structure.views_per_point() >= 3)
    assert len(kept.points_world) == 20 and len(kept.observation_views) == 60
    assert kept.reprojection_errors().max() < 1e-9
