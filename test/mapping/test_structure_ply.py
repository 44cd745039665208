import numpy as np
import pytest
from small_structure import small_structure

from bodycam_ros.mapping.structure_ply import write_ply


def test_points_come_in_their_colours_and_cameras_in_red(tmp_path):
    structure, _ = small_structure()
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
