import numpy as np
import pytest
import trimesh

from bodycam_ros.errors import BodyError
from bodycam_ros.outside.closed_surface import closed_surface
from bodycam_ros.outside.surface import OPEN, Surface


def as_trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def two_balls() -> trimesh.Trimesh:
    """Apart from each other, of 1 and 2 dm; a part each."""
    near, far = (trimesh.creation.icosphere(subdivisions=2, radius=radius) for radius in (0.1, 0.2))
    far.apply_translation([1.0, 0.0, 0.0])
    return trimesh.util.concatenate([near, far])


def test_seams_and_poles_are_sewn_up() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    soup = np.asarray(ball.triangles).reshape(-1, 3)  # every face has vertices of its own, a little off
    soup = soup + np.random.default_rng(3).uniform(-2e-6, 2e-6, soup.shape)
    faces = np.arange(len(soup)).reshape(-1, 3)
    empty = np.array([[0, 0, 1], [4, 4, 4], [3, 4, 3]])
    surface = closed_surface("head", soup, np.concatenate([faces, empty]))
    assert surface.vertices.shape == ball.vertices.shape and surface.faces.shape == ball.faces.shape
    assert (surface.edge_faces != OPEN).all()
    assert as_trimesh(surface).volume == pytest.approx(ball.volume, rel=1e-4)


def test_a_part_that_is_inside_out_is_turned() -> None:
    mesh = two_balls()
    faces = np.array(mesh.faces)
    half = len(faces) // 2
    for inside_out in (slice(0, half), slice(half, None), slice(None)):
        turned = faces.copy()
        turned[inside_out] = turned[inside_out, ::-1]
        assert as_trimesh(closed_surface("head", mesh.vertices, turned)).volume == pytest.approx(mesh.volume)


def test_faces_that_are_wound_any_way_are_wound_alike() -> None:
    mesh = two_balls()
    faces = np.array(mesh.faces)
    any_way = np.random.default_rng(1).random(len(faces)) < 0.4
    faces[any_way] = faces[any_way, ::-1]
    surface = closed_surface("head", mesh.vertices, faces)
    assert as_trimesh(surface).volume == pytest.approx(mesh.volume)
    assert (surface.edge_faces != OPEN).all()


def test_a_hole_does_not_turn_a_part_inside_out() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    ball.apply_translation([0.0, 0.0, 5.0])  # far from the origin, from where the hole weighs more than the ball
    open_above = np.array(ball.faces)[ball.triangles_center[:, 2] < 5.05]
    surface = closed_surface("head", ball.vertices, open_above)
    middle = surface.vertices[surface.faces].mean(axis=1) - [0.0, 0.0, 5.0]
    assert ((surface.face_normals * middle).sum(axis=1) > 0.0).all()
    assert (surface.edge_faces == OPEN).any()


def test_faces_that_come_twice_count_once_and_sheets_go() -> None:
    box = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    sheet = np.array([[8, 9, 10], [10, 9, 8]])
    vertices = np.concatenate([box.vertices, np.eye(3)])
    surface = closed_surface("head", vertices, np.concatenate([box.faces, box.faces[:3], sheet]))
    assert len(surface.faces) == 12 and len(surface.vertices) == 8


def test_thousands_of_vertices_on_one_spot_take_no_memory() -> None:
    box = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    heap = np.zeros((60_000, 3))  # as pairs, 1.8 thousand million
    heap_faces = np.arange(60_000).reshape(-1, 3) + len(box.vertices)
    surface = closed_surface("head", np.concatenate([box.vertices, heap]), np.concatenate([box.faces, heap_faces]))
    assert len(surface.faces) == 12


def test_a_mesh_without_an_area_is_refused() -> None:
    with pytest.raises(BodyError, match="the mesh of head has no face with an area"):
        closed_surface("head", np.zeros((3, 3)), np.array([[0, 1, 2]]))
