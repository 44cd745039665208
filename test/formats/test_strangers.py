"""Files of strangers that were read wrongly, as they were found; the folder lies beside the repository."""

import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest

from bodycam_ros.camera import camera_from_yaml
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP
from bodycam_ros.formats.read_captured import read_captured
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.lens.lens_check import match_images

STRANGERS = Path(__file__).parents[3] / "shared" / "strangers"
pytestmark = pytest.mark.skipif(not STRANGERS.is_dir(), reason=f"{STRANGERS.name}: not beside this repository")


def test_a_tab_more_before_the_names_shifts_no_marker() -> None:
    points = read_captured(STRANGERS / "trc_names_extra_tab/a.trc").points
    np.testing.assert_array_equal(points["RKNE"][0], Y_UP_TO_Z_UP @ [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(points["LKNE"][0], Y_UP_TO_Z_UP @ [4.0, 5.0, 6.0])


def test_zeros_are_the_same_gaps_as_empty_cells() -> None:
    zeros, blank = (read_captured(STRANGERS / f"trc_zeros/{name}.trc").points for name in ("zeros", "blank_same_gaps"))
    assert zeros.keys() == blank.keys()
    for name, points in blank.items():
        assert np.isnan(points).any() and not np.isnan(points).all() or np.isfinite(points).all()
        np.testing.assert_allclose(zeros[name], points, atol=1e-6, err_msg=name)


def test_six_zeros_of_a_knee_are_missing() -> None:
    points = read_captured(STRANGERS / "trc_zeros_few/one.trc").points
    missing = {name: int(np.isnan(rows[:, 0]).sum()) for name, rows in points.items() if np.isnan(rows).any()}
    assert missing == {"knee_left": 6}


def test_a_c3d_of_70000_frames_is_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(STRANGERS / "c3d_over_65535/make.py"))
    captured = read_captured(tmp_path / "long.c3d")
    assert len(captured.stamps_ns) == 70_000
    assert captured.points["RKNE"][-1, 0] == pytest.approx(0.69999)


def test_kalibr_and_caliscope_are_read() -> None:
    (camera,) = read_static_cameras(STRANGERS / "kalibr_camchain_yaml/camchain.yaml").values()
    assert (camera.name, camera.camera.fx, camera.camera.width) == ("cam0", 400.0, 640)
    assert [*read_static_cameras(STRANGERS / "caliscope_one_uncalibrated/camera_array.toml")] == ["cam_1", "cam_2"]


def test_a_plane_that_shifts_does_not_doubt_its_lens() -> None:
    folder = STRANGERS / "lens_warning_flat_scene"
    video, images = cv2.VideoCapture(str(folder / "head.mp4")), []
    while (frame := video.read())[0]:
        images.append(np.asarray(cv2.cvtColor(frame[1], cv2.COLOR_BGR2GRAY), np.uint8))
    video.release()
    match = match_images(camera_from_yaml(folder / "head.yaml"), images)
    assert match.pairs >= 4 and match.matches
