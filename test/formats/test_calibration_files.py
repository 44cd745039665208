"""Calibrations of other programs: the same cameras by every format, and what is wrong is named."""

import logging
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


KALIBR = """{head}cam0:
  {pose0}
  camera_model: pinhole
  distortion_coeffs: {D}
  distortion_model: {model}
  intrinsics: [900.0, 905.0, 530.5, 961.25]
  resolution: [1088, 1920]
cam1:
  {pose1}
  camera_model: pinhole
  distortion_coeffs: {D}
  distortion_model: {model}
  intrinsics: [900.0, 905.0, 530.5, 961.25]
  resolution: [1088, 1920]
"""
FIRST, SECOND = (station.world_T_camera for station in STATIONS.values())


@pytest.mark.parametrize("head", ["", "%YAML:1.0\n", "%YAML:1.0 # as OpenCV wants it\n\n---\n"])
@pytest.mark.parametrize(
    ("poses", "expected"),
    [
        (("T_imu_cam", FIRST, "T_imu_cam", SECOND), (FIRST, SECOND)),
        (("T_cam_imu", inverse(FIRST), "T_cam_imu", inverse(SECOND)), (FIRST, SECOND)),
        (("T_imu_cam", FIRST, "T_cn_cnm1", inverse(SECOND) @ FIRST), (FIRST, SECOND)),
        (("cam_overlaps", np.ones(1), "T_cn_cnm1", inverse(SECOND) @ FIRST), (np.eye(4), inverse(FIRST) @ SECOND)),
    ],
    ids=["OpenVINS", "imu", "imu and chain", "chain"],
)
def test_kalibr_has_cameras_by_a_sensor_or_by_each_other(
    tmp_path: Path, head: str, poses: tuple[str, np.ndarray, str, np.ndarray], expected: tuple[np.ndarray, np.ndarray]
) -> None:
    places = [f"{key}: {value.tolist()}" for key, value in zip(poses[::2], poses[1::2], strict=True)]
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR.format(head=head, pose0=places[0], pose1=places[1], D=D[:4], model="radtan"))
    found = read_static_cameras(path)
    assert [*found] == ["cam0", "cam1"]
    for station, pose in zip(found.values(), expected, strict=True):
        np.testing.assert_allclose(station.world_T_camera, pose, atol=1e-9)
        np.testing.assert_allclose(station.camera.k, K)
        assert station.camera.distortion[:4] == tuple(D[:4])
        assert station.camera.distortion_model == "plumb_bob"


def test_kalibr_s_equi_is_equidistant(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    poses = {f"pose{k}": f"T_imu_cam: {pose.tolist()}" for k, pose in enumerate((FIRST, SECOND))}
    path.write_text(KALIBR.format(head="", **poses, D=D[:4], model="equi"))
    assert {station.camera.distortion_model for station in read_static_cameras(path).values()} == {"equidistant"}


@pytest.mark.parametrize("form", ["toml", "kalibr", "qca", "opencv"])
def test_a_camera_that_cannot_be_used_is_left_out_and_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, form: str
) -> None:
    """Caliscope keeps cameras that it could not link, with "null" for a pose."""
    if form == "toml":
        path = tmp_path / "c.toml"
        pose = r"(?s)(cam02.*?rotation = )\[.*?\]\ntranslation = \[.*?\]"
        path.write_text(re.sub(pose, r'\1"null"\ntranslation = "null"', toml_text(STATIONS.values())))
    elif form == "kalibr":
        path = tmp_path / "c.yaml"
        text = KALIBR.format(head="", pose0=f"T_imu_cam: {FIRST.tolist()}", pose1="a: 1", D=D[:4], model="radtan")
        path.write_text(text.replace("cam0", "cam01").replace("cam1:", "cam02:"))
    elif form == "qca":
        path = tmp_path / "c.qca.txt"
        numbers = " ".join(f'r{i}{j}="{float(i == j)}"' for i in (1, 2, 3) for j in (1, 2, 3))
        keys = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
        lens = " ".join(f'{key}="64000"' for key in ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV"))
        lens = " ".join([lens, *(f'{key}="0"' for key in keys)])
        view = '<fov_video left="0" top="0" right="1999" bottom="1999"/>'
        whole = f'<camera serial="cam01">{view}<transform {numbers} x="1" y="2" z="3"/><intrinsic {lens}/></camera>'
        path.write_text(f'<calibration>{whole}<camera serial="cam02">{view}<intrinsic {lens}/></camera></calibration>')
    else:
        path = tmp_path / "c.yml"
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        for name in STATIONS:
            storage.write(f"K_{name}", np.reshape(K, (3, 3)))
            storage.write(f"W_{name}", 1088)
            storage.write(f"H_{name}", 1920)
        storage.write("R_cam01", np.zeros((3, 1)))
        storage.write("T_cam01", np.ones((3, 1)))
        storage.release()
    caplog.set_level(logging.WARNING)
    assert [*read_static_cameras(path)] == ["cam01"]
    assert "camera 'cam02': left out: " in caplog.text


@pytest.mark.parametrize("place", ["images/cam01/000000.png", "cam01/a.png"])
def test_a_size_that_lacks_is_that_of_the_images_beside_the_file(tmp_path: Path, place: str) -> None:
    storage = cv2.FileStorage(str(tmp_path / "intri.yml"), cv2.FILE_STORAGE_WRITE)
    for key, value in {"K": np.reshape(K, (3, 3)), "R": np.zeros((3, 1)), "T": np.ones((3, 1))}.items():
        storage.write(f"{key}_cam01", value)
    storage.release()
    with pytest.raises(StaticCameraError, match="camera cam01: has no size; expected W_cam01"):
        read_static_cameras(tmp_path / "intri.yml")
    (tmp_path / place).parent.mkdir(parents=True)
    cv2.imwrite(str(tmp_path / place), np.zeros((1920, 1088), np.uint8))
    camera = read_static_cameras(tmp_path / "intri.yml")["cam01"].camera
    assert (camera.width, camera.height) == (1088, 1920)


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("c.toml", "a = ", ("TOML",)),
        ("c.toml", "[metadata]\nerror = 0.0", ()),
        ("c.toml", "[c]\nmatrix = [[1, 0], [0, 1]]\nsize = [4, 4]", ("camera c", "matrix", "3 x 3")),
        ("c.toml", f"[c]\nmatrix = {np.eye(3).tolist()}\nsize = [4, 4]", ("camera c", "rotation", "translation")),
        (
            "c.toml",
            f"[c]\nmatrix = {np.eye(3).tolist()}\nsize = [4, 4]\nrotation = [0, 0, 90]\ntranslation = [0, 0, 0]",
            ("camera c", "rotation", "radians", "90"),
        ),
        ("c.qca.txt", "<calibration", ("XML",)),
        ("c.qca.txt", '<!DOCTYPE a [<!ENTITY b "c">]><calibration/>', ("<!DOCTYPE>",)),
        ("c.qca.txt", '<calibration><camera serial="1"/></calibration>', ("camera 1", "fov_video", "right")),
        ("c.yml", "%YAML:1.0\n---\nA: 1\n", ("K_NAME",)),
        ("c.yml", "%YAML:1.0\n---\nA:\n  b: [1, 2]\n", ("K_NAME",)),
        ("c.yml", "%YAML:1.0\n---\nK_a:\n  b: [1, 2]\nW_a: 4\nH_a: 4\n", ("camera a", "matrix", "3 x 3")),
        ("c.yml", "%YAML:1.0\ncam0:\n  camera_model: omni\n  intrinsics: [1]\n", ("camera_model", "omni")),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, name: str, text: str, named: tuple[str, ...]) -> None:
    path = tmp_path / name
    path.write_text(text)
    with naming(StaticCameraError, path, *named):
        read_static_cameras(path)


@pytest.mark.parametrize(
    ("moved", "told"), [([0.02, -0.05, 0.01, 0.02, -0.01, 0.08], True), ([1.6, 0, 0, 0, 0, 1], False)]
)
def test_a_world_that_is_nearly_the_frame_of_a_camera_has_no_upward_axis(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, moved: list[float], told: bool
) -> None:
    first = StaticCamera("first", exp_se3(np.array(moved, float)), STATIONS["cam01"].camera)
    (tmp_path / "a.toml").write_text(toml_text([first, STATIONS["cam02"]]))
    read_static_cameras(tmp_path / "a.toml")
    assert ("its world is the frame of one camera, first, whose z axis is not up" in caplog.text) == told


def test_a_rig_by_its_inertial_sensor_has_no_upward_axis_either(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pose = exp_se3(np.array([1.2, -1.2, 1.2, 0.1, 0.0, 0.0])).tolist()
    (tmp_path / "camchain.yaml").write_text(
        f"%YAML:1.0\ncam0:\n  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  distortion_model: radtan\n"
        f"  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [640, 480]\n  T_cam_imu: {pose}\n"
    )
    read_static_cameras(tmp_path / "camchain.yaml")
    assert "its world is its inertial sensor's, whose z axis may not be up" in caplog.text


def test_a_byte_order_mark_and_another_alphabet_are_no_traceback(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("\ufeff" + toml_text(STATIONS.values()), encoding="utf-8")
    assert_same(read_static_cameras(tmp_path / "a.toml"))
    (tmp_path / "a.yml").write_bytes("%YAML:1.0\n---\nK_hüfte: 1\n".encode("cp1252"))
    with pytest.raises(StaticCameraError, match="cannot be read as YAML of OpenCV"):
        read_static_cameras(tmp_path / "a.yml")
