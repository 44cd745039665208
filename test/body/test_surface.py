"""Edges and planes of a body's surface, on meshes that can be counted by hand."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.body.surface import NOBODY, OPEN, BodySurface, Surface, edges_of, join_meshes
from bodycam_ros.errors import BodyError

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int32)
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def test_each_edge_of_a_closed_mesh_has_its_two_faces_once() -> None:
    edges, sides = edges_of(TETRAHEDRON)
    assert {frozenset(edge) for edge in edges.tolist()} == {
        frozenset(p) for p in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
    }
    assert len(edges) == 6 and (sides != OPEN).all()
    for (start, end), (first, second) in zip(edges.tolist(), sides.tolist(), strict=True):
        ahead = list(zip(TETRAHEDRON[first].tolist(), np.roll(TETRAHEDRON[first], -1).tolist(), strict=True))
        back = list(zip(TETRAHEDRON[second].tolist(), np.roll(TETRAHEDRON[second], -1).tolist(), strict=True))
        assert (start, end) in ahead and (end, start) in back


def test_a_hole_is_open() -> None:
    edges, sides = edges_of(TETRAHEDRON[1:])
    assert len(edges) == 6
    assert {frozenset(edge) for edge in edges[(sides == OPEN).any(axis=1)].tolist()} == {
        frozenset(pair) for pair in ((0, 1), (1, 2), (0, 2))
    }


def test_an_edge_of_four_faces_is_two_edges() -> None:
    vertices, faces = join_meshes([(CORNERS, TETRAHEDRON), (CORNERS + 3.0, TETRAHEDRON)])
    assert len(vertices) == 8 and faces.max() == 7
    glued = np.where(faces == 4, 0, np.where(faces == 5, 1, faces))  # both now share the edge 0-1
    edges, sides = edges_of(glued)
    shared = [side for edge, side in zip(edges.tolist(), sides, strict=True) if set(edge) == {0, 1}]
    assert len(edges) == 12 and len(shared) == 2
    assert sorted(np.concatenate(shared).tolist()) == sorted(
        np.flatnonzero([{0, 1} <= {*face} for face in glued.tolist()])
    )


def test_normals_point_outward_and_are_twice_the_area() -> None:
    normals = Surface(CORNERS, TETRAHEDRON).scaled_normals
    assert ((CORNERS[TETRAHEDRON].mean(axis=1) - CORNERS.mean(axis=0)) * normals).sum(axis=1).min() > 0.0
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), [1.0, 1.0, np.sqrt(3.0), 1.0])


def test_rows_of_a_body_are_those_of_their_segments() -> None:
    body = body_of_height(1.8, "person")
    head, foot = body.segment_index["head"], body.segment_index["foot_left"]
    surfaces = {"foot_left": Surface(CORNERS + 1.0, TETRAHEDRON), "head": Surface(CORNERS, TETRAHEDRON)}
    whole = BodySurface.of(body, surfaces)
    assert whole.segment_count == len(body.segments)
    for segment, surface in ((head, surfaces["head"]), (foot, surfaces["foot_left"])):
        np.testing.assert_array_equal(whole.vertices[whole.segment_of_vertex == segment], surface.vertices)
        assert set(whole.faces[whole.segment_of_face == segment].ravel()) == set(
            np.flatnonzero(whole.segment_of_vertex == segment)
        )
    np.testing.assert_allclose(np.linalg.norm(whole.face_normals, axis=1), 1.0)
    corners = whole.vertices[whole.faces]
    np.testing.assert_allclose(
        np.einsum("fcj,fj->fc", corners, whole.face_normals), np.tile(whole.face_offsets[:, None], 3), atol=1e-12
    )


def test_a_body_without_a_surface_or_with_too_many_segments_is_refused() -> None:
    body = body_of_height(1.8, "person")
    with naming(BodyError, "body person", 0, len(body.segments)):
        BodySurface.of(body, {"tail": Surface(CORNERS, TETRAHEDRON)})
    chain = [f"s{number}" for number in range(NOBODY)]
    joints = [replace(body.joints[0], name=c, parent=p, child=c) for p, c in zip(chain, chain[1:], strict=False)]
    long = replace(body, name="snake", root="s0", segments=tuple(chain), joints=tuple(joints))
    with naming(BodyError, "body snake", NOBODY, NOBODY - 1):
        BodySurface.of(long, {"s0": Surface(CORNERS, TETRAHEDRON)})


@pytest.mark.parametrize("count", [1, 3])
def test_joined_meshes_keep_their_faces(count: int) -> None:
    vertices, faces = join_meshes([(CORNERS + k, TETRAHEDRON) for k in range(count)])
    for k in range(count):
        np.testing.assert_array_equal(vertices[faces[4 * k : 4 * k + 4]], (CORNERS + k)[TETRAHEDRON])
