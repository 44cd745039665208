"""The view draws fewer faces and landmarks where told, of the same shape."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bodycam_ros.body.body_file import read_body
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.surface import Surface
from bodycam_ros.view.detail import COARSE, FINE, Detail

BODY = Path(__file__).parents[2] / "bags/body.yaml"
SURFACES = capsule_surfaces(read_body(BODY))


@pytest.mark.parametrize(("detail", "apart_m"), [(FINE, 0.01), (COARSE, 0.03)], ids=["fine", "coarse"])
@pytest.mark.parametrize("segment", ["torso", "head", "thigh_left", "foot_right"])
def test_the_shape_stays(segment: str, detail: Detail, apart_m: float) -> None:
    surface = SURFACES[segment]
    vertices, faces = detail.mesh(surface.vertices, surface.faces)
    assert len(faces) <= detail.faces < len(surface.faces)
    drawn = trimesh.Trimesh(vertices, faces, process=False)
    _, distances, _ = trimesh.proximity.closest_point_naive(drawn, surface.vertices)
    assert distances.max() < apart_m


def test_a_small_mesh_is_drawn_as_it_is() -> None:
    surface: Surface = SURFACES["pelvis"]
    vertices, faces = replace(FINE, faces=len(surface.faces)).mesh(surface.vertices, surface.faces)
    assert vertices is surface.vertices
    assert faces is surface.faces


@pytest.mark.parametrize("landmarks", [0, 1, 3999, 4000, 4001, 21554, 1_000_000])
def test_no_more_landmarks_than_told_are_drawn_and_no_small_map_is_thinned(landmarks: int) -> None:
    drawn = np.arange(landmarks)[COARSE.chosen(landmarks)]
    assert min(landmarks, COARSE.landmarks // 2) <= len(drawn) <= COARSE.landmarks
    assert landmarks > COARSE.landmarks or len(drawn) == landmarks


def test_the_page_of_a_coarse_view_asks_for_fewer_pixels() -> None:
    assert (FINE.page, COARSE.page) == ("", "/?fixedDpr=0.4")
