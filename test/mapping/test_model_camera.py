"""The camera that a COLMAP model was made with."""

from pathlib import Path

import pycolmap
import pytest

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.photographs import camera_of_model


def model(folder: Path, *cameras: pycolmap.Camera) -> Path:
    """A model whose photographs were taken by cameras, one each."""
    reconstruction = pycolmap.Reconstruction()
    for number, camera in enumerate(cameras, start=1):
        camera.camera_id = number
        reconstruction.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(name=f"{number}.jpg", camera_id=number, image_id=number)
        reconstruction.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    folder.mkdir()
    reconstruction.write(folder)
    return folder


def camera(name: str = "SIMPLE_RADIAL", parameters: tuple[float, ...] = (500.0, 320.5, 240.5, -0.1)) -> pycolmap.Camera:
    return pycolmap.Camera(model=name, width=640, height=480, params=parameters)


def test_one_camera_is_taken_even_if_the_model_has_it_for_each_photograph(tmp_path: Path) -> None:
    found = camera_of_model(model(tmp_path / "model", camera(), camera()))
    assert (found.distortion_model, found.width, found.height) == ("plumb_bob", 640, 480)
    assert (found.fx, found.fy, found.cx, found.cy) == (500.0, 500.0, 320.0, 240.0)
    assert found.distortion == (-0.1, 0.0, 0.0, 0.0, 0.0)


def test_several_cameras_are_refused(tmp_path: Path) -> None:
    other = camera(parameters=(510.0, 320.5, 240.5, -0.1))
    with pytest.raises(MapError, match=r"2 cameras"):
        camera_of_model(model(tmp_path / "model", camera(), other))


def test_a_lens_model_that_is_not_known_is_refused(tmp_path: Path) -> None:
    prism = camera("THIN_PRISM_FISHEYE", (500.0, 500.0, 320.0, 240.0, *[0.01] * 8))
    with pytest.raises(MapError, match="THIN_PRISM_FISHEYE"):
        camera_of_model(model(tmp_path / "model", prism))
