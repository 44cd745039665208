"""Calibrations of other programs: the same cameras by every format, and what is wrong is named."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.camera import camera_from_info
from bodycam_ros.cli.main import main
from bodycam_ros.errors import StaticCameraError
from bodycam_ros.formats.calibration_files import toml_text
from bodycam_ros.formats.static_cameras_file import read_static_cameras, write_static_cameras
from bodycam_ros.geometry import exp_se3, inverse, log_so3
from bodycam_ros.static_cameras.static_camera import StaticCamera

K = [900.0, 0.0, 530.5, 0.0, 905.0, 961.25, 0.0, 0.0, 1.0]
D = [-0.03, 0.01, 0.001, -0.002, 0.0]
STATIONS = {
    name: StaticCamera(name, exp_se3(np.array(xi)), camera_from_info(name, 1088, 1920, "plumb_bob", D, K))
    for name, xi in {"cam01": [0.3, -1.2, 0.8, 2.5, -0.1, 1.25], "cam02": [1.1, 0.4, -0.3, -3.0, 2.0, 1.5]}.items()
}


def assert_same(found: dict[str, StaticCamera]) -> None:
    assert list(found) == list(STATIONS)
    for name, station in STATIONS.items():
        np.testing.assert_allclose(found[name].world_T_camera, station.world_T_camera, atol=1e-6)
        np.testing.assert_allclose(found[name].camera.k, station.camera.k, atol=1e-6)
        np.testing.assert_allclose(found[name].camera.distortion, D, atol=1e-9)
        assert (found[name].camera.width, found[name].camera.height) == (1088, 1920)


@pytest.mark.parametrize("scale", [1.0, 1000.0], ids=["m", "mm"])
def test_toml_is_read_in_the_unit_that_its_cameras_are_apart_by(tmp_path: Path, scale: float) -> None:
    lines = []
    for name, station in STATIONS.items():
        camera_T_world = inverse(station.world_T_camera)
        lines += [
            f"[int_{name}]", f'name = "{name}"', "size = [ 1088.0, 1920.0,]",
            f"matrix = {np.reshape(K, (3, 3)).tolist()}", f"distortions = {D[:4]}",
            f"rotation = {log_so3(camera_T_world[:3, :3]).tolist()}",
            f"translation = {(scale * camera_T_world[:3, 3]).tolist()}", "fisheye = false",
        ]  # fmt: skip
    path = tmp_path / "Calib.toml"
    path.write_text("\n".join([*lines, "[metadata]", "adjusted = false"]))
    assert_same(read_static_cameras(path))


def test_toml_that_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text(toml_text(STATIONS.values()))
    assert_same(read_static_cameras(path))


def test_cameras_of_two_tables_may_have_the_same_key(tmp_path: Path) -> None:
    text = toml_text(STATIONS.values())
    for header, key in zip(re.findall(r"^\[.*\]", text, re.MULTILINE), ("[front.0]", "[rear.0]"), strict=False):
        text = text.replace(header, key)
    path = tmp_path / "cameras.toml"
    path.write_text(text)
    assert_same(read_static_cameras(path))


def test_qualisys_has_64ths_of_a_pixel_millimetres_and_a_camera_that_looks_backwards(tmp_path: Path) -> None:
    cameras = []
    for name, station in STATIONS.items():
        axes = station.world_T_camera[:3, :3].T * [[1.0], [-1.0], [-1.0]]
        rotation = " ".join(f'r{i + 1}{j + 1}="{axes[i, j]}"' for i in range(3) for j in range(3))
        x, y, z = 1000.0 * station.world_T_camera[:3, 3]
        fx, fy, cx, cy, k1, k2, p1, p2 = 64.0 * np.array([K[0], K[4], K[2], K[5], *D[:4]])
        cameras.append(
            f'<camera serial="{name}" viewrotation="0"><fov_video left="0" top="0" right="1087" bottom="1919"/>'
            f'<transform {rotation} x="{x}" y="{y}" z="{z}"/><intrinsic focalLengthU="{fx}" focalLengthV="{fy}" '
            f'centerPointU="{cx}" centerPointV="{cy}" radialDistortion1="{k1}" radialDistortion2="{k2}" '
            f'tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/></camera>'
        )
    path = tmp_path / "Calib.qca.txt"
    path.write_text(f"<calibration><cameras>{''.join(cameras)}</cameras></calibration>")
    assert_same(read_static_cameras(path))


def test_opencv_yaml_may_be_two_files(tmp_path: Path) -> None:
    for file in ("intri", "extri"):
        storage = cv2.FileStorage(str(tmp_path / f"{file}.yml"), cv2.FILE_STORAGE_WRITE)
        for name, station in STATIONS.items():
            camera_T_world = inverse(station.world_T_camera)
            if file == "intri":
                storage.write(f"K_{name}", np.reshape(K, (3, 3)))
                storage.write(f"dist_{name}", np.array([D]))
                storage.write(f"W_{name}", 1088)
                storage.write(f"H_{name}", 1920)
            else:
                storage.write(f"R_{name}", log_so3(camera_T_world[:3, :3]).reshape(3, 1))
                storage.write(f"T_{name}", camera_T_world[:3, 3:].copy())
        storage.release()
    assert_same(read_static_cameras(tmp_path / "extri.yml"))


def test_the_command_converts_in_both_directions(tmp_path: Path) -> None:
    write_static_cameras(tmp_path / "cameras.yaml", STATIONS.values())
    there, back = tmp_path / "there.toml", tmp_path / "back.yaml"
    assert main(["stations", str(tmp_path / "cameras.yaml"), "--to", "toml", "-o", str(there)]) == 0
    assert main(["stations", str(there), "-o", str(back)]) == 0
    assert_same(read_static_cameras(back))


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("c.toml", "a = ", ("TOML",)),
        ("c.toml", "[metadata]\nerror = 0.0", ()),
        ("c.toml", "[c]\nmatrix = [[1, 0], [0, 1]]\nsize = [4, 4]", ("camera c", "matrix", "3 x 3")),
        ("c.toml", f"[c]\nmatrix = {np.eye(3).tolist()}\nsize = [4, 4]", ("camera c", "rotation", "3")),
        ("c.qca.txt", "<calibration", ("XML",)),
        ("c.qca.txt", '<!DOCTYPE a [<!ENTITY b "c">]><calibration/>', ("<!DOCTYPE>",)),
        ("c.qca.txt", '<calibration><camera serial="1"/></calibration>', ("camera 1", "fov_video", "right")),
        ("c.yml", "%YAML:1.0\n---\nA: 1\n", ("K_NAME",)),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, name: str, text: str, named: tuple[str, ...]) -> None:
    path = tmp_path / name
    path.write_text(text)
    with naming(StaticCameraError, path, *named):
        read_static_cameras(path)
