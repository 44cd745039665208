"""A robot's URDF names files and may come from anybody: no address is opened, no device read, no size believed."""

import os
from pathlib import Path

import pytest
from helpers.limited_memory import limited_memory
from helpers.naming import naming
from helpers.talos import talos_urdf

from bodycam_ros.errors import BodyError
from bodycam_ros.robot.mapping import RobotMapping
from bodycam_ros.robot.robot_model import Robot

_MESH = (
    '<robot name="r"><link name="base"><collision><geometry><mesh filename="{}"/></geometry></collision></link></robot>'
)


@pytest.fixture(scope="module", autouse=True)
def readers() -> None:
    """Loads them; skips where they are not installed."""
    Robot(talos_urdf(), RobotMapping("base_link", {}, path="m.yaml"))


def refused(folder: Path, document: str, named: str) -> None:
    urdf = folder / "robot.urdf"
    urdf.write_text(document)
    with limited_memory(), naming(BodyError, urdf, named):
        Robot(urdf, RobotMapping("base", {}, path="m.yaml"))


@pytest.mark.parametrize("scheme", ["http", "https", "ftp"])
def test_a_mesh_is_not_fetched(scheme: str, tmp_path: Path) -> None:
    refused(tmp_path, _MESH.format(f"{scheme}://127.0.0.1:9/a.stl"), f"Schemes of form '{scheme}' are not handled")


@pytest.mark.parametrize("place", ["file:///dev/zero", "/dev/zero", "zero.stl", "pipe.stl", "bomb.stl", "bomb.ply"])
def test_a_mesh_that_never_ends(place: str, tmp_path: Path) -> None:
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "bomb.stl").write_bytes(bytes(80) + (4_000_000_000).to_bytes(4, "little") + bytes(200))
    lines = ["ply", "format ascii 1.0", "element vertex 4000000000", *(f"property float {axis}" for axis in "xyz")]
    (tmp_path / "bomb.ply").write_text("\n".join([*lines, "end_header", "0 0 0", ""]))
    refused(tmp_path, _MESH.format(place), "Could not load resource")


def test_elements_without_end(tmp_path: Path) -> None:
    refused(tmp_path, f"<robot name='r'>{'<a>' * 100_000}{'</a>' * 100_000}</robot>", "valid URDF")


def test_entities_stand_for_nothing(tmp_path: Path) -> None:
    """Neither for gigabytes nor for files."""
    bomb = "".join(f'<!ENTITY b{k + 1} "{f"&b{k};" * 10}">' for k in range(9))
    file = '<!ENTITY file SYSTEM "file:///etc/hostname">'
    document = f'<!DOCTYPE robot [<!ENTITY b0 "lol">{bomb}{file}]><robot name="r"><link name="&b9;&file;"/></robot>'
    (tmp_path / "robot.urdf").write_text(document)
    with limited_memory(), naming(BodyError, "m.yaml", "robot.urdf", "link base"):
        Robot(
            tmp_path / "robot.urdf",
            RobotMapping("base", {}, path="m.yaml"),
        )
