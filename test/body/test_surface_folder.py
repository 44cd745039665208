import logging
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.naming import naming

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.surface_folder import read_surfaces
from bodycam_ros.errors import BodyError
from bodycam_ros.kinematics.joint import Joint


@pytest.fixture
def body() -> BodyModel:
    knee = Joint("knee", "thigh", "shin", "ball", np.eye(4))
    return BodyModel("leg", "thigh", ("thigh", "shin"), (knee,), {})


def thigh(scale: float = 1.0) -> trimesh.Trimesh:
    """As long as a thigh [m], from its origin downwards."""
    mesh = trimesh.creation.capsule(height=0.4, radius=0.07, count=(16, 16))
    mesh.apply_translation([0.0, 0.0, 0.07 - mesh.bounds[1, 2]])
    mesh.apply_scale(scale)
    return mesh


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_what_trimesh_wrote_is_read(tmp_path: Path, body: BodyModel, suffix: str) -> None:
    mesh = thigh()
    mesh.export(tmp_path / f"thigh.{suffix}")
    surfaces = read_surfaces(tmp_path, body)
    assert list(surfaces) == ["thigh"]
    np.testing.assert_allclose(np.sort(surfaces["thigh"].vertices, axis=0), np.sort(mesh.vertices, axis=0), atol=1e-6)
    read = trimesh.Trimesh(surfaces["thigh"].vertices, surfaces["thigh"].faces)
    assert read.is_watertight and read.volume == pytest.approx(mesh.volume, rel=1e-4)


def test_a_library_that_is_not_installed_is_named(
    tmp_path: Path, body: BodyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    thigh().export(tmp_path / "thigh.obj")
    libraries = {"fast_simplification_that_nobody_has": "fast-simplification", "networkx": "networkx"}
    monkeypatch.setattr("bodycam_ros.body.surface_folder._LIBRARIES", libraries)
    with pytest.raises(BodyError, match="pip install fast-simplification$"):
        read_surfaces(tmp_path, body)


def test_hands_that_the_body_does_not_have_are_left_out_and_named(
    tmp_path: Path, body: BodyModel, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("thigh", "hand_left", "hand_right"):
        thigh().export(tmp_path / f"{name}.obj")
    with caplog.at_level(logging.WARNING):
        assert list(read_surfaces(tmp_path, body)) == ["thigh"]
    (line,) = caplog.messages
    assert "hand_left, hand_right" in line


def test_an_obj_opens_no_other_file(tmp_path: Path, body: BodyModel) -> None:
    os.mkfifo(tmp_path / "skin.mtl")  # would wait for ever
    (tmp_path / "thigh.obj").write_text(f"mtllib skin.mtl\nusemtl skin\n{thigh().export(file_type='obj')}")
    assert len(read_surfaces(tmp_path, body)["thigh"].faces) > 100


def test_a_folder_that_is_none_or_empty_is_refused(tmp_path: Path, body: BodyModel) -> None:
    with naming(BodyError, tmp_path / "nowhere"):
        read_surfaces(tmp_path / "nowhere", body)
    with naming(BodyError, "thigh.obj"):
        read_surfaces(tmp_path, body)
    for suffix in ("obj", "ply"):
        thigh().export(tmp_path / f"thigh.{suffix}")
    with naming(BodyError, "thigh.obj", "thigh.ply"):
        read_surfaces(tmp_path, body)


@pytest.mark.parametrize("scale", [1000.0, 100.0, 0.001])
def test_other_units_are_refused(tmp_path: Path, body: BodyModel, scale: float) -> None:
    thigh(scale).export(tmp_path / "thigh.obj", digits=9)
    with naming(BodyError, "thigh.obj"):
        read_surfaces(tmp_path, body)


def test_a_mesh_in_the_frame_of_the_room_is_refused(tmp_path: Path, body: BodyModel) -> None:
    mesh = thigh()
    mesh.apply_translation([0.0, 0.0, 1.2])
    mesh.export(tmp_path / "thigh.obj")
    with naming(BodyError, tmp_path / "thigh.obj"):
        read_surfaces(tmp_path, body)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("thigh.ply", b"not a mesh"),
        ("thigh.ply", bytes(range(256))),
        ("thigh.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n"),
        ("thigh.obj", b""),
        ("thigh.obj", b"v 0 0 0\nv 0 1 0\nv 1 1 0\n"),
        ("thigh.obj", b"v 0 0 0\nv 0 .1 0\nv .1 .1 0\nf 1 2 9\n"),
        ("thigh.obj", b"v 0 0 nan\nv 0 .1 0\nv .1 .1 0\nf 1 2 3\n"),
        ("thigh.obj", b"v 0 0 0\nv 0 .1 0\nv 0 .2 0\nf 1 2 3\n"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path: Path, body: BodyModel, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with naming(BodyError, name):
        read_surfaces(tmp_path, body)


def test_what_is_wrong_with_a_mesh_is_told_and_not_what_went_wrong(tmp_path: Path, body: BodyModel) -> None:
    vertices = b"".join(b"%g %g 0\n" % (0.1 * (number % 3), 0.1 * (number // 3)) for number in range(9))
    header = b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n"
    header += b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    for name, content in (("thigh.ply", header + vertices + b"3 0 1 98\n"), ("thigh.obj", b"v 0 0 0\nf 1 2 99\n")):
        (tmp_path / name).write_bytes(content)
        with naming(BodyError, name) as caught:
            read_surfaces(tmp_path, body)
        assert "Error" not in str(caught.value) and "vertices that it does not have" in str(caught.value)
        (tmp_path / name).unlink()


def test_too_many_faces_are_refused(tmp_path: Path, body: BodyModel) -> None:
    faces = np.tile(np.arange(3), (200_001, 1))
    trimesh.Trimesh(0.1 * np.eye(3), faces, process=False).export(tmp_path / "thigh.ply")
    with naming(BodyError, "thigh.ply"):
        read_surfaces(tmp_path, body)
