import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bodycam_ros.body.body_edit import move_joint
from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.outside.chosen_surface import surfaces_of


@pytest.fixture
def body_path(sample: Path, tmp_path: Path) -> Path:
    path = tmp_path / "body.yaml"
    path.write_text((sample / "body.yaml").read_text())
    return path


def write_meshes(folder: Path, body: BodyModel, radius: float) -> None:
    folder.mkdir()
    for segment in body.segments:
        trimesh.creation.icosphere(subdivisions=1, radius=radius).export(folder / f"{segment}.ply")


def radius_of(body: BodyModel, path: Path, folder: Path | None = None) -> float:
    return float(np.linalg.norm(surfaces_of(body, path, folder)["head"].vertices, axis=1).max())


def test_what_is_asked_for_comes_before_the_body_s_own_and_that_before_capsules(body_path: Path) -> None:
    body = read_body(body_path)
    assert set(surfaces_of(body, body_path)) == set(body.segments)
    assert radius_of(body, body_path) > 0.2
    write_meshes(body_path.parent / "scan", body, 0.1)
    write_meshes(body_path.parent / "other", body, 0.15)
    write_body(replace(body, surface="scan"), body_path)
    # The folder that the body names is beside it, from wherever it is run; and stays named when a joint is moved.
    body = read_body(body_path)
    neck = next(joint for joint in body.joints if joint.name == "neck")
    body = move_joint(body, "neck", neck.parent_T_joint)
    assert radius_of(body, body_path) == pytest.approx(0.1)
    assert radius_of(body, body_path, body_path.parent / "other") == pytest.approx(0.15)


def test_a_folder_that_the_body_names_and_is_not_there_is_refused(body_path: Path) -> None:
    body = replace(read_body(body_path), surface="scan")
    with pytest.raises(BodyError, match="scan: expected a folder with an OBJ or PLY file a segment"):
        surfaces_of(body, body_path)


def test_segments_without_a_mesh_are_named(body_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    body = read_body(body_path)
    write_meshes(body_path.parent / "scan", body, 0.1)
    (body_path.parent / "scan" / "foot_left.ply").unlink()
    with caplog.at_level(logging.WARNING):
        surfaces = surfaces_of(body, body_path, body_path.parent / "scan")
    assert set(surfaces) == {*body.segments} - {"foot_left"}
    assert caplog.messages == [f"{body_path.parent / 'scan'}: has no mesh of foot_left; static cameras do not see them"]
