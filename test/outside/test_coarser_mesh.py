import numpy as np
import trimesh
from scipy.spatial import cKDTree

from bodycam_ros.outside.closed_surface import closed_surface
from bodycam_ros.outside.coarser_mesh import coarser_mesh
from bodycam_ros.outside.surface import OPEN


def test_a_scan_of_eighty_thousand_faces_keeps_its_form() -> None:
    scan = trimesh.creation.icosphere(subdivisions=6, radius=1.0)
    scan.apply_scale([0.15, 0.2, 0.3])
    vertices, faces = coarser_mesh(np.asarray(scan.vertices), np.asarray(scan.faces, np.int32), 2000)
    assert 1500 < len(faces) <= 2000
    surface = closed_surface("torso", vertices, faces)
    assert (surface.edge_faces != OPEN).mean() > 0.99
    off, _ = cKDTree(scan.vertices).query(vertices)
    assert off.max() < 0.005
    coarse = trimesh.Trimesh(surface.vertices, surface.faces)
    assert 0.97 < coarse.volume / scan.volume < 1.0


def test_parts_that_overlap_are_not_mixed() -> None:
    parts = [trimesh.creation.icosphere(subdivisions=4, radius=0.1) for _ in range(2)]
    parts[1].apply_translation([0.11, 0.0, 0.0])
    both = trimesh.util.concatenate(parts)
    vertices, faces = coarser_mesh(np.asarray(both.vertices), np.asarray(both.faces, np.int32), 1000)
    assert trimesh.Trimesh(vertices, faces, process=False).body_count == 2


def test_a_mesh_that_is_coarse_is_left_alone() -> None:
    box = trimesh.creation.box()
    vertices, faces = coarser_mesh(np.asarray(box.vertices), np.asarray(box.faces, np.int32), 12)
    assert vertices is box.vertices or np.array_equal(vertices, box.vertices)
    assert np.array_equal(faces, box.faces)
