import numpy as np
import pycolmap
import pytest
from helpers.small_structure import small_structure

from bodycam_ros.mapping import colmap


@pytest.fixture
def model(tmp_path):
    structure = small_structure()
    colmap.write_model(tmp_path / "sparse", tmp_path / "structure.ply", structure)
    return structure, tmp_path / "sparse"


def cameras(structure):
    """By the names of the photographs."""
    return {name: structure.cameras[row] for name, row in zip(structure.names, structure.camera_of_view, strict=True)}


def test_the_model_reprojects_in_colmap_itself(model):
    structure, folder = model
    reconstruction = pycolmap.Reconstruction(folder)
    assert reconstruction.num_reg_images() == 3 and reconstruction.num_points3D() == len(structure.points_world)
    for image in reconstruction.images.values():
        for point2D in image.points2D:
            projected = image.project_point(reconstruction.points3D[point2D.point3D_id].xyz)
            assert projected == pytest.approx(point2D.xy, abs=1e-6)


def test_a_model_comes_back_as_it_was_written(model):
    structure, folder = model
    back = colmap.structure_from(pycolmap.Reconstruction(folder), cameras(structure))
    assert list(back.names) == list(structure.names)
    assert back.cameras == structure.cameras and np.array_equal(back.camera_of_view, structure.camera_of_view)
    assert np.allclose(back.world_T_camera, structure.world_T_camera, atol=1e-12)
    assert np.allclose(back.points_world, structure.points_world)
    assert np.array_equal(back.colours, structure.colours)
    assert back.reprojection_errors().max() < 1e-6


def test_adjustment_mends_poses_without_touching_the_intrinsics(model):
    structure, folder = model
    reconstruction = pycolmap.Reconstruction(folder)
    before = {number: list(camera.params) for number, camera in reconstruction.cameras.items()}
    for point in reconstruction.points3D.values():
        point.xyz = point.xyz + np.random.default_rng(2).normal(0.0, 0.01, 3)
    colmap.adjust(reconstruction, workers=1)
    assert colmap.structure_from(reconstruction, cameras(structure)).reprojection_errors().max() < 1e-3
    assert {number: list(camera.params) for number, camera in reconstruction.cameras.items()} == before
