"""Cameras from camera_info: what is accepted, and what is refused with which words."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.camera import CameraModel, camera_from_info, camera_from_yaml
from bodycam_ros.camera.camera_info import camera_info_yaml
from bodycam_ros.errors import LensError

K = [300.0, 0.0, 320.0, 0.0, 301.0, 240.0, 0.0, 0.0, 1.0]
GOOD: dict[str, Any] = {"width": 640, "height": 480, "distortion_model": "plumb_bob", "d": [0.0] * 5, "k": K}


def k_with(**entries: float) -> list[float]:
    names = ["fx", "skew", "cx", "zero_a", "fy", "cy", "zero_b", "zero_c", "one"]
    return [entries.get(name, value) for name, value in zip(names, K, strict=True)]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"distortion_model": "thin_prism"}, ("thin_prism",)),
        ({"d": [0.1] * 3}, ("0 or 4 or 5", 3)),
        ({"distortion_model": "fov", "d": [0.9, 0.0]}, ("omega", 2)),
        ({"distortion_model": "fov", "d": [-0.1]}, ("omega",)),
        ({"distortion_model": "rational_polynomial", "d": [0.1] * 12}, ("d[8:]",)),
        ({"d": [np.nan, 0, 0, 0, 0]}, ("d",)),
        ({"d": [0, -1e300, 0, 0, 0]}, ("d", -1e300)),
        ({"width": 10**6, "height": 10**6}, ("1000000 x 1000000",)),
        ({"d": ["a", 0, 0, 0, 0]}, ("d",)),
        ({"k": k_with(fx=np.nan)}, ("k",)),
        ({"k": k_with(fx=-300.0)}, ("fx", -300)),
        ({"k": k_with(skew=0.5)}, ("skew", 0.5)),
        ({"k": [0.0] * 9}, ()),
        ({"width": 0}, ("0 x 480",)),
    ],
)
def test_what_is_wrong_is_said(change: dict[str, Any], named: tuple[object, ...]) -> None:
    with naming(LensError, "camera head", *named):
        camera_from_info("head", **{**GOOD, **change})


def document() -> dict[str, Any]:
    return {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "head",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K},
        "distortion_model": "equidistant",
        "distortion_coefficients": {"rows": 1, "cols": 4, "data": [0.1, 0.0, 0.0, 0.0]},
    }


def test_yaml_of_ros_is_read(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text(yaml.safe_dump(document()))
    camera = camera_from_yaml(path)
    assert camera.name == "head"
    assert camera.distortion_model == "equidistant"
    assert (camera.width, camera.fx, camera.distortion[0]) == (640, 300.0, 0.1)
    assert camera_from_yaml(path, "foot_left").name == "foot_left"
    path.write_text(yaml.safe_dump({k: v for k, v in document().items() if k != "camera_name"}))
    assert camera_from_yaml(path).name == "left"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"image_width": "wide"}, ("image_width", "wide")),
        ({"camera_matrix": K}, ("camera_matrix",)),
        ({"distortion_coefficients": {"data": None}}, ("d",)),
    ],
)
def test_wrong_field_names_the_file(tmp_path: Path, change: dict[str, Any], named: tuple[object, ...]) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump({**document(), **change}))
    with naming(LensError, path, *named):
        camera_from_yaml(path)


def test_a_camera_that_is_written_is_read_back(tmp_path: Path, lens: CameraModel) -> None:
    (tmp_path / "camera.yaml").write_text(camera_info_yaml(lens))
    again = camera_from_yaml(tmp_path / "camera.yaml")
    assert (again.name, type(again)) == (lens.name, type(lens))
    np.testing.assert_array_equal(again.parameters, lens.parameters)


@pytest.mark.parametrize(
    ("names", "d", "fisheye", "model"),
    [
        (("image_width", "image_height", "camera_matrix", "distortion_coefficients"), 5, 0, "plumb_bob"),
        (("image_Width", "image_Height", "Camera_Matrix", "Distortion_Coefficients"), 5, None, "plumb_bob"),
        (("image_width", "image_height", "camera_matrix", "distortion_coefficients"), 8, 0, "rational_polynomial"),
        (("image_width", "image_height", "camera_matrix", "distortion_coefficients"), 4, 1, "equidistant"),
    ],
)
def test_what_opencv_s_calibration_writes_is_a_lens(
    tmp_path: Path, names: tuple[str, ...], d: int, fisheye: int | None, model: str
) -> None:
    path, coefficients = tmp_path / "out_camera_data.yml", 0.01 * np.arange(1.0, 1.0 + d)
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in zip(names, (640, 480, np.reshape(K, (3, 3)), coefficients[:, None]), strict=True):
        file.write(name, value)
    if fisheye is not None:
        file.write("fisheye_model", fisheye)
    file.release()
    camera = camera_from_yaml(path, "head")
    assert (camera.width, camera.height, camera.distortion_model) == (640, 480, model)
    np.testing.assert_allclose(camera.distortion, coefficients)
    np.testing.assert_allclose(camera.k, K)


def test_a_driver_without_calibration_is_told_so() -> None:
    with naming(LensError, "camera head", "no calibration", "measure the lens"):
        camera_from_info("head", 640, 480, "", [], [0.0] * 9)
