from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from bodycam_ros.outside.closed_surface import closed_surface
from bodycam_ros.outside.surface import OPEN, Surface

CAMERA = np.array([1.3, -0.4, 0.7])


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return closed_surface("head", np.asarray(mesh.vertices), np.asarray(mesh.faces))


def contour_points(surface: Surface, camera: NDArray[np.float64], per_edge: int = 5) -> NDArray[np.float64]:
    start, end = surface.vertices[surface.edges[surface.contour(camera)].T]
    return (start + np.linspace(0.0, 1.0, per_edge)[:, None, None] * (end - start)).reshape(-1, 3)


def test_the_contour_of_a_ball_is_the_circle_that_a_pinhole_camera_sees() -> None:
    radius, distance = 0.12, float(np.linalg.norm(CAMERA))
    points = contour_points(surface_of(trimesh.creation.icosphere(subdivisions=4, radius=radius)), CAMERA)
    rays = (points - CAMERA) / np.linalg.norm(points - CAMERA, axis=1, keepdims=True)
    angles = np.arccos(rays @ (-CAMERA / distance))
    np.testing.assert_allclose(angles, np.arcsin(radius / distance), rtol=0.01)
    assert len(points) > 100


def test_the_contour_is_closed() -> None:
    surface = surface_of(trimesh.creation.icosphere(subdivisions=2, radius=0.1))
    ends = surface.edges[surface.contour(CAMERA)]
    _, meetings = np.unique(ends, return_counts=True)
    assert (meetings == 2).all()


def test_edges_and_faces_know_each_other() -> None:
    mesh = trimesh.creation.box(extents=(0.2, 0.3, 0.4))
    surface = surface_of(mesh)
    assert len(surface.edges) == 18 and (surface.edge_faces != OPEN).all()
    for edge, (along, against) in zip(surface.edges, surface.edge_faces, strict=True):
        directed = [tuple(np.roll(surface.faces[along], -k)[:2]) for k in range(3)]
        assert tuple(edge) in directed
        directed = [tuple(np.roll(surface.faces[against], -k)[:2]) for k in range(3)]
        assert tuple(edge[::-1]) in directed
    towards = surface.faces_towards(np.array([5.0, 0.0, 0.0]))
    np.testing.assert_array_equal(towards, surface.face_normals[:, 0] > 0.5)
    np.testing.assert_allclose(np.unique(surface.face_offsets.round(9)), [0.1, 0.15, 0.2])


def test_the_rim_of_a_hole_is_contour() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    surface = Surface("head", np.asarray(mesh.vertices), np.asarray(mesh.faces[1:], np.int32))
    assert (surface.edge_faces[:, 1] == OPEN).sum() == 3
    rim = np.flatnonzero(surface.edge_faces[:, 1] == OPEN)
    for camera in (CAMERA, -CAMERA):
        assert np.isin(rim, surface.contour(camera)).all()


def test_three_sheets_on_one_edge_are_taken_in_pairs() -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], float)
    surface = Surface("head", vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], np.int32))
    on_edge = (surface.edges == [0, 1]).all(axis=1) | (surface.edges == [1, 0]).all(axis=1)
    assert sorted(map(tuple, surface.edge_faces[on_edge])) == [(0, 1), (2, OPEN)]


@pytest.mark.parametrize("part", ["torso", "head", "foot_left"])
def test_the_scans_of_the_recordings_are_closed(shared: Path, part: str) -> None:
    path = shared / "dev_outside_cycle" / "body" / f"{part}.obj"
    if not path.is_file():
        pytest.skip("the recording with static cameras (../shared/recordings/dev_outside_cycle) is not on this machine")
    mesh = trimesh.load_mesh(path, process=False)
    surface = surface_of(mesh)
    assert len(surface.edges) * 2 == len(surface.faces) * 3 and (surface.edge_faces != OPEN).all()
    assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(mesh.volume)
