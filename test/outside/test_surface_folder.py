import logging
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.errors import BodyError
from bodycam_ros.outside.surface_folder import KEPT_FACES, read_surfaces


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


def test_ascii_ply_and_capital_suffixes_are_read(tmp_path: Path, body: BodyModel) -> None:
    thigh().export(tmp_path / "thigh.ply", encoding="ascii")
    (tmp_path / "thigh.ply").rename(tmp_path / "thigh.PLY")
    thigh().export(tmp_path / "shin.obj")
    (tmp_path / "notes.txt").write_text("scanned in May")
    assert set(read_surfaces(tmp_path, body)) == {"thigh", "shin"}


def test_a_scan_of_many_faces_is_made_coarser(tmp_path: Path, body: BodyModel) -> None:
    mesh = thigh().subdivide().subdivide().subdivide()
    mesh.export(tmp_path / "thigh.ply")
    surface = read_surfaces(tmp_path, body)["thigh"]
    assert len(mesh.faces) > 10_000 and len(surface.faces) <= KEPT_FACES
    assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(mesh.volume, rel=0.03)


def test_hands_that_the_body_does_not_have_are_left_out_and_named(
    tmp_path: Path, body: BodyModel, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("thigh", "hand_left", "hand_right"):
        thigh().export(tmp_path / f"{name}.obj")
    with caplog.at_level(logging.WARNING):
        assert list(read_surfaces(tmp_path, body)) == ["thigh"]
    (line,) = caplog.messages
    assert "leaves out hand_left, hand_right, which body leg does not have" in line


def test_an_obj_opens_no_other_file(tmp_path: Path, body: BodyModel) -> None:
    os.mkfifo(tmp_path / "skin.mtl")  # would wait for ever
    text = thigh().export(file_type="obj")
    (tmp_path / "thigh.obj").write_text(f"mtllib skin.mtl\nusemtl skin\n{text}")
    assert len(read_surfaces(tmp_path, body)["thigh"].faces) > 100


def test_a_folder_that_is_none_or_empty_is_refused(tmp_path: Path, body: BodyModel) -> None:
    with pytest.raises(BodyError, match=r"nowhere: expected a folder with an OBJ or PLY file a segment: No such file"):
        read_surfaces(tmp_path / "nowhere", body)
    with pytest.raises(
        BodyError, match=r"has no mesh of any segment of body leg; .* thigh\.obj or thigh\.ply, and found"
    ):
        read_surfaces(tmp_path, body)
    (tmp_path / "thigh.obj").write_text("v 0 0 0\n")
    with pytest.raises(BodyError, match="Not a directory"):
        read_surfaces(tmp_path / "thigh.obj", body)
    (tmp_path / "thigh.ply").write_text("")
    with pytest.raises(BodyError, match=r"has thigh\.obj and thigh\.ply; keep one"):
        read_surfaces(tmp_path, body)


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        (1000.0, r"thigh\.obj: is 540 m large, as no segment is; .*looks like millimetres \(0\.54 m\): scale it"),
        (100.0, r"is 54 m large, .*looks like centimetres \(0\.54 m\)"),
        (0.001, r"is 0\.00054 m large, as no segment is; meshes are in metres: scale it"),
    ],
)
def test_other_units_are_named(tmp_path: Path, body: BodyModel, scale: float, said: str) -> None:
    thigh(scale).export(tmp_path / "thigh.obj", digits=9)
    with pytest.raises(BodyError, match=said):
        read_surfaces(tmp_path, body)


def test_a_mesh_in_the_frame_of_the_room_is_refused(tmp_path: Path, body: BodyModel) -> None:
    mesh = thigh()
    mesh.apply_translation([0.0, 0.0, 1.2])
    mesh.export(tmp_path / "thigh.obj")
    with pytest.raises(
        BodyError, match=r"begins 0\.73 m from its segment's origin; expected it in the segment's frame"
    ):
        read_surfaces(tmp_path, body)


def test_what_is_no_mesh_is_refused(tmp_path: Path, body: BodyModel) -> None:
    def refused(name: str, content: bytes, said: str) -> None:
        (tmp_path / name).write_bytes(content)
        with pytest.raises(BodyError, match=said):
            read_surfaces(tmp_path, body)
        (tmp_path / name).unlink()

    refused("thigh.ply", b"not a mesh", r"thigh\.ply: cannot be read as a mesh")
    refused("thigh.ply", bytes(range(256)), r"thigh\.ply: cannot be read as a mesh")
    refused("thigh.obj", b"", r"thigh\.obj: ")
    refused("thigh.obj", b"v 0 0 0\nv 0 1 0\nv 1 1 0\n", r"thigh\.obj: .*faces")
    refused("thigh.obj", b"v 0 0 0\nv 0 .1 0\nv .1 .1 0\nf 1 2 9\n", r"thigh\.obj: ")
    refused("thigh.obj", b"v 0 0 nan\nv 0 .1 0\nv .1 .1 0\nf 1 2 3\n", r"thigh\.obj: .*not finite")
    refused("thigh.obj", b"v 0 0 0\nv 0 .1 0\nv 0 .2 0\nf 1 2 3\n", r"thigh\.obj: .*no face with an area")
    (tmp_path / "thigh.obj").mkdir()
    with pytest.raises(BodyError, match=r"thigh\.obj: .*"):
        read_surfaces(tmp_path, body)


def test_a_truncated_file_is_refused(tmp_path: Path, body: BodyModel) -> None:
    content = thigh().export(file_type="ply")
    (tmp_path / "thigh.ply").write_bytes(content[: len(content) // 2])
    with pytest.raises(BodyError, match=r"thigh\.ply: cannot be read"):
        read_surfaces(tmp_path, body)


def test_too_many_faces_are_refused(tmp_path: Path, body: BodyModel) -> None:
    faces = np.tile(np.arange(3), (200_001, 1))
    trimesh.Trimesh(0.1 * np.eye(3), faces, process=False).export(tmp_path / "thigh.ply")
    with pytest.raises(BodyError, match=r"thigh\.ply: has 200001 faces, more than 200000; decimate it"):
        read_surfaces(tmp_path, body)
