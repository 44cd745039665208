"""Meshes of limbs against the solids that they stand for: volume, size, direction."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import Ball, capsule_surfaces, limb_mesh
from bodycam_ros.geometry import Array, exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint

_X, _Y, _Z = np.eye(3)


def solid(start: Array, end: Array, balls: list[Ball], across: Array = _Y) -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(*limb_mesh(start, end, balls, across), process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    return mesh


def test_one_ball_is_a_ball() -> None:
    mesh = solid(np.zeros(3), _Z, [Ball(0.0, 0.1)])
    assert mesh.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.1**3, rel=0.02)
    np.testing.assert_allclose(mesh.center_mass, 0.0, atol=1e-6)


def test_two_balls_are_a_capsule_with_its_inertia() -> None:
    length, radius = 0.4, 0.06
    mesh = solid(np.zeros(3), length * _Z, [Ball(0.0, radius), Ball(1.0, radius)])
    assert mesh.volume == pytest.approx(np.pi * radius**2 * (length + 4.0 / 3.0 * radius), rel=0.02)
    np.testing.assert_allclose(mesh.center_mass, [0.0, 0.0, 0.5 * length], atol=1e-3)
    np.testing.assert_allclose(mesh.bounds[:, 2], [-radius, length + radius], atol=1e-9)


def test_a_limb_is_as_wide_as_its_circle_over_all_directions() -> None:
    """The mean width of a convex outline is its perimeter over pi (Cauchy)."""
    vertices, _ = limb_mesh(np.zeros(3), 0.4 * _Z, [Ball(0.0, 0.06), Ball(1.0, 0.06)], _Y)
    middle = vertices[:, 2][np.abs(vertices[:, 2] - 0.2).argmin()]
    ring = vertices[np.isclose(vertices[:, 2], middle), :2]
    perimeter = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum()
    assert perimeter / np.pi == pytest.approx(2.0 * 0.06, rel=1e-3)


def test_a_thinner_end_makes_a_cone_that_touches_both_balls() -> None:
    """Its volume is that of the hull of both, which trimesh has of points on them."""
    balls, length = [Ball(0.0, 0.08), Ball(1.0, 0.04)], 0.4
    sphere = trimesh.creation.icosphere(5).vertices
    hull = trimesh.convex.convex_hull(
        np.concatenate([ball.radius * sphere + ball.along * length * _Z for ball in balls])
    )
    assert solid(np.zeros(3), length * _Z, balls).volume == pytest.approx(hull.volume, rel=0.02)


def test_breadth_and_depth_are_along_their_axes() -> None:
    mesh = solid(np.zeros(3), 0.3 * _Z, [Ball(0.0, 0.05, 2.0, 0.5), Ball(1.0, 0.05, 2.0, 0.5)], across=_Y)
    size = np.ptp(mesh.vertices, axis=0)
    assert size[1] == pytest.approx(0.2, rel=0.02) and size[0] == pytest.approx(0.05, rel=0.02)


def test_a_mesh_turns_with_its_line() -> None:
    turn = exp_so3(np.array([0.4, -0.8, 0.3]))
    balls = [Ball(0.0, 0.05, 1.5), Ball(1.0, 0.03, 1.2)]
    straight, faces = limb_mesh(np.zeros(3), 0.3 * _Z, balls, _X)
    turned, same = limb_mesh(_X, _X + 0.3 * turn @ _Z, balls, turn @ _X)
    np.testing.assert_array_equal(faces, same)
    np.testing.assert_allclose(turned, straight @ turn.T + _X, atol=1e-12)


def test_a_line_along_the_broad_side_is_no_singular_case() -> None:
    assert solid(np.zeros(3), 0.3 * _Y, [Ball(0.0, 0.05, 2.0), Ball(1.0, 0.05, 2.0)], across=_Y).volume > 0.0


def test_girths_make_segments_thicker_and_no_longer() -> None:
    body = body_of_height(1.8, "person")
    thick = replace(body, girths={"thigh_left": 1.5})
    usual, wide = capsule_surfaces(body)["thigh_left"], capsule_surfaces(thick)["thigh_left"]
    across = [np.ptp(surface.vertices[:, 1]) for surface in (usual, wide)]
    assert across[1] / across[0] == pytest.approx(1.5, rel=1e-3)
    np.testing.assert_array_equal(
        capsule_surfaces(thick)["thigh_right"].vertices, capsule_surfaces(body)["thigh_right"].vertices
    )


def test_a_segment_of_another_name_is_a_capsule_along_each_bone() -> None:
    joints = tuple(
        Joint(child, "trunk", child, "ball", rigid(np.eye(3), np.array(place)))
        for child, place in (("left", [0.0, 0.3, 0.0]), ("right", [0.0, -0.3, 0.0]), ("near", [0.0, 0.0, 0.01]))
    )
    surfaces = capsule_surfaces(BodyModel("t", "trunk", ("trunk", "left", "right", "near"), joints, {}))
    assert list(surfaces) == ["trunk"], "segments without a bone have no surface"
    trunk = surfaces["trunk"]
    parts = trimesh.Trimesh(trunk.vertices, trunk.faces, process=False).split()
    assert len(parts) == 2
    np.testing.assert_allclose(np.sort([part.center_mass[1] for part in parts]), [-0.15, 0.15], atol=1e-6)
