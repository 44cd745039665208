from pathlib import Path

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.formats.static_cameras_file import write_static_cameras
from bodycam_ros.ingest.find_videos import CameraFiles, find_videos
from bodycam_ros.ingest.ingest_camera import read_lens
from bodycam_ros.static_cameras.static_camera import StaticCamera


def touch(folder: Path, *names: str) -> list[Path]:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return [folder / name for name in names]


def found(given: list[Path], lens_folder: Path | None = None) -> dict[str, list[str]]:
    return {files.camera: [path.name for path in files.paths] for files in find_videos(given, lens_folder)[0]}


def test_each_file_of_a_folder_is_a_camera(tmp_path: Path) -> None:
    touch(tmp_path, "head.mp4", "shin_left.MP4", "head.yaml", "notes.txt", "._head.mp4", "sound.wav")
    assert found([tmp_path]) == {"head": ["head.mp4"], "shin_left": ["shin_left.MP4"]}


@pytest.mark.parametrize(
    ("names", "camera"),
    [
        (("GH010123.MP4", "GH020123.MP4", "GH030123.MP4"), "GH010123"),
        (("GX010123.MP4", "GX020123.MP4"), "GX010123"),
        (("GOPR0123.MP4", "GP010123.MP4", "GP020123.MP4"), "GOPR0123"),
        (("head_1.mp4", "head_2.mp4", "head_3.mp4"), "head"),
        (("head.mp4", "head_2.mp4"), "head"),
    ],
)
def test_chapters_are_joined(tmp_path: Path, names: tuple[str, ...], camera: str) -> None:
    files = touch(tmp_path, *names)
    touch(tmp_path, "other.mp4", "GH010999.MP4")
    expected = {camera: list(names), "other": ["other.mp4"], "GH010999": ["GH010999.MP4"]}
    assert found([tmp_path]) == expected
    assert found(files[::-1]) == {camera: list(names)}


def test_numbers_are_not_chapters_where_each_has_its_lens(tmp_path: Path) -> None:
    touch(tmp_path, "waist_1.mp4", "waist_2.mp4", "waist_1.yaml", "waist_2.yaml")
    assert found([tmp_path]) == {"waist_1": ["waist_1.mp4"], "waist_2": ["waist_2.mp4"]}
    lenses = tmp_path / "lenses"
    touch(lenses, "waist_2.yaml")
    (tmp_path / "waist_2.yaml").unlink()
    assert list(found([tmp_path], lenses)) == ["waist_1", "waist_2"]
    assert list(found([tmp_path])) == ["waist"]


def test_numbers_with_a_gap_are_not_chapters(tmp_path: Path) -> None:
    touch(tmp_path, "head_1.mp4", "head_3.mp4", "take_7.mp4")
    assert list(found([tmp_path])) == ["head_1", "head_3", "take_7"]


def test_a_folder_for_each_camera(tmp_path: Path) -> None:
    touch(tmp_path, "head/GH010001.MP4", "head/GH020001.MP4", "shin/GH010001.MP4", "docs/readme.txt")
    assert found([tmp_path]) == {"head": ["GH010001.MP4", "GH020001.MP4"], "shin": ["GH010001.MP4"]}


def test_a_folder_with_a_lens_is_a_camera_beside_videos_too(tmp_path: Path) -> None:
    touch(tmp_path, "head.mp4", "shin/GH010001.MP4", "shin/GH020001.MP4", "foot/1.jpg", "old/head.mp4")
    touch(tmp_path, "shin.yaml", "foot/foot.yaml", "old/head.yaml")
    shin = {"shin": ["GH010001.MP4", "GH020001.MP4"]}
    assert found([tmp_path]) == {"head": ["head.mp4"], **shin, "foot": ["1.jpg"]}
    touch(tmp_path, "lens/shin.yaml")
    cameras, _ = find_videos([tmp_path], tmp_path / "lens")
    assert {files.camera for files in cameras} == {"head", "shin"}


def test_several_recordings_of_one_camera_are_named_and_the_rest_goes_on(tmp_path: Path) -> None:
    touch(tmp_path, "head.mp4", "shin.mp4", "again/head.mp4")
    cameras, causes = find_videos([tmp_path, tmp_path / "again"])
    assert [files.camera for files in cameras] == ["shin"]
    assert list(causes) == ["head"] and str(tmp_path / "again" / "head.mp4") in causes["head"]
    touch(tmp_path / "folders", "head/GH010001.MP4", "head/GH010002.MP4", "shin/GH010001.MP4")
    cameras, causes = find_videos([tmp_path / "folders"])
    assert [files.camera for files in cameras] == ["shin"] and list(causes) == ["head"]
    # One file by two names is one file.
    assert found([tmp_path, tmp_path / "head.mp4"]) == {"head": ["head.mp4"], "shin": ["shin.mp4"]}


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with naming(RecordingError, tmp_path / "odd.mp4"):
        find_videos([tmp_path / "odd.mp4"])
    with naming(RecordingError, tmp_path):
        find_videos([tmp_path])
    touch(tmp_path, "bag/metadata.yaml")
    with naming(RecordingError, tmp_path / "bag"):
        find_videos([tmp_path / "bag"])


@pytest.mark.parametrize("form", ["yaml", "toml"])
def test_a_file_of_static_cameras_has_their_lenses(tmp_path: Path, form: str) -> None:
    k = [1681.0, 0, 533, 0, 1682.0, 948, 0, 0, 1]
    lens = camera_from_info("cam01", 1088, 1920, "plumb_bob", [0.1, 0.0, 0.0, 0.0, 0.0], k)
    calibration = tmp_path / f"cameras.{form}"
    write_static_cameras(calibration, [StaticCamera("cam01", np.eye(4), lens)], form)
    (video,) = touch(tmp_path, "cam01.mp4")
    read, readout_s, path = read_lens(CameraFiles("cam01", (video,)), calibration)
    assert (read.width, read.height, path, readout_s) == (1088, 1920, calibration, None)
    np.testing.assert_allclose(read.k, k, atol=1e-6)
    with naming(LensError, calibration, "cam02", "cam01"):
        read_lens(CameraFiles("cam02", (video,)), calibration)


def test_where_the_lens_is(tmp_path: Path) -> None:
    video, lens, elsewhere, camera_lens = touch(
        tmp_path, "head/GH010001.MP4", "head/GH010001.yaml", "lenses/head.yaml", "head.yaml"
    )
    files = CameraFiles("head", (video,))
    assert files.lens_path(None) == lens
    assert files.lens_path(elsewhere.parent) == elsewhere
    lens.unlink()
    assert files.lens_path(None) == camera_lens
    camera_lens.unlink()
    with naming(LensError, video, "head.yaml"):
        files.lens_path(None)
