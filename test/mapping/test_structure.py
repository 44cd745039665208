import numpy as np
import pytest
from small_structure import small_structure

from bodycam_ros.geometry import exp_so3
from bodycam_ros.mapping.structure import distinct, write_ply


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


def test_a_point_behind_the_camera_is_infinitely_wrong():
    structure = small_structure()
    structure.points_world[0] = structure.world_T_camera[0, :3, 3] - structure.world_T_camera[0, :3, 2]
    errors = structure.reprojection_errors()
    assert np.isinf(errors[0])


def test_cameras_are_named_once_in_the_order_of_the_photographs():
    wide, fisheye = small_structure().cameras
    camera_of_name = {"a": wide, "b": fisheye, "c": wide, "d": wide}
    for names, expected in {"abcd": [0, 1, 0, 0], "bca": [0, 1, 1], "ca": [0, 0]}.items():
        cameras, rows = distinct([camera_of_name[name] for name in names])
        assert rows.tolist() == expected
        assert all(cameras[row] is camera_of_name[name] for name, row in zip(names, rows, strict=True))


def test_points_come_in_their_colours_and_cameras_in_red(tmp_path):
    structure = small_structure()
    write_ply(tmp_path / "s.ply", structure)
    header, _, body = (tmp_path / "s.ply").read_bytes().partition(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert [line.split()[1:] for line in lines[3:]] == [
        ["float", "x"], ["float", "y"], ["float", "z"], ["uchar", "red"], ["uchar", "green"], ["uchar", "blue"]
    ]  # fmt: skip
    vertices = np.frombuffer(body, dtype="<f4, <f4, <f4, u1, u1, u1")
    assert lines[2] == f"element vertex {len(vertices)}"
    assert list(vertices[5])[:3] == pytest.approx(structure.points_world[5], abs=1e-6)
    assert list(vertices[5])[3:] == structure.colours[5].tolist()
    red = [list(v)[:3] for v in vertices if list(v)[3:] == [255, 0, 0]]
    for pose in structure.world_T_camera:
        assert np.linalg.norm(np.array(red) - pose[:3, 3], axis=1).min() < 1e-5
