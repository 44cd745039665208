"""Pictures of a lens from real files: images, folders, videos; of one size, each with a name of its own."""

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.made_video import HEIGHT, RATE_HZ, WIDTH, make_video, number_in
from helpers.naming import names, naming

from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.lens import lens_images as module
from bodycam_ros.lens.lens_images import LensImage, illuminated_pixels, lens_images


def _write(path: Path, grey: int = 100, size: tuple[int, int] = (48, 64)) -> Path:
    path.parent.mkdir(exist_ok=True)
    assert cv2.imwrite(str(path), np.full(size, grey, np.uint8))
    return path


def test_an_image_that_is_given_by_itself_and_by_its_folder_counts_once(tmp_path: Path) -> None:
    first, second = _write(tmp_path / "a" / "1.png", 10), _write(tmp_path / "a" / "2.PNG", 20)
    (tmp_path / "a" / "notes.txt").write_text("no picture")
    pictures = lens_images([first, tmp_path / "a", tmp_path / "a"])
    assert [picture.name for picture in pictures] == ["1.png", "2.PNG"]
    assert [int(picture.grey[0, 0]) for picture in pictures] == [10, 20]
    assert second.exists()


def test_images_of_one_name_keep_their_folders(tmp_path: Path) -> None:
    paths = [_write(tmp_path / folder / "1.png") for folder in ("left", "right")]
    other = _write(tmp_path / "left" / "2.png")
    pictures = lens_images([*paths, other])
    assert [picture.name for picture in pictures] == [*map(str, paths), "2.png"]


def test_of_many_images_some_are_taken_from_begin_to_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(9):
        _write(tmp_path / f"{number}.png")
    monkeypatch.setattr(module, "_MOST_PICTURES", 5)
    assert [picture.name for picture in lens_images([tmp_path])] == ["0.png", "2.png", "4.png", "6.png", "8.png"]
    monkeypatch.setattr(module, "_MOST_BYTES", 3 * 48 * 64)
    assert [picture.name for picture in lens_images([tmp_path])] == ["0.png", "4.png", "8.png"]


def test_of_a_video_the_sharpest_frame_of_each_part_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    video = make_video(tmp_path / "board.mp4", frames=12)
    monkeypatch.setattr(module, "_MOST_PICTURES", 4)
    monkeypatch.setattr(module, "sharpness", lambda grey: -abs(number_in(grey) % 3 - 1))
    pictures = lens_images([video])
    assert [number_in(picture.grey) for picture in pictures] == [1, 4, 7, 10]
    assert all(names(picture.name, "board.mp4") for picture in pictures)
    assert [picture.name.split()[-2] for picture in pictures] == [f"{n / RATE_HZ:.2f}" for n in (1, 4, 7, 10)]
    assert pictures[0].grey.shape == (HEIGHT, WIDTH)


def test_what_is_no_picture_is_named(tmp_path: Path) -> None:
    with naming(LensError, tmp_path / "none.png"):
        lens_images([tmp_path / "none.png"])
    (tmp_path / "empty").mkdir()
    with naming(LensError, tmp_path / "empty"):
        lens_images([tmp_path / "empty"])
    (tmp_path / "odd.jpg").write_bytes(b"no picture")
    with naming(RecordingError, tmp_path / "odd.jpg"):
        lens_images([tmp_path / "odd.jpg"])
    (tmp_path / "odd.mp4").write_bytes(b"no video")
    with naming(RecordingError, tmp_path / "odd.mp4"):
        lens_images([tmp_path / "odd.mp4"])


def test_the_disc_of_a_fisheye_is_what_is_ever_lit() -> None:
    height, width = 480, 640
    down, across = np.mgrid[:height, :width]
    disc = np.hypot(across - 319.5, down - 239.5) < 200.0
    halves = [across < 320, across >= 320]  # each picture has light in one half only
    pictures = [LensImage(str(n), np.where(disc & half, 120, 4).astype(np.uint8)) for n, half in enumerate(halves)]
    lit = illuminated_pixels(pictures)
    assert lit.shape == (height, width)
    border = np.abs(np.hypot(across - 319.5, down - 239.5) - 200.0) < 12.0  # seen by cells of eight pixels
    np.testing.assert_array_equal(lit[~border], disc[~border])


def _write_sizes(folder: Path, sizes: list[tuple[int, int]]) -> Path:
    for number, (width, height) in enumerate(sizes):
        _write(folder / f"{number}.png", 90, (height, width))
    return folder


def test_pictures_of_the_size_that_most_have_are_taken(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A first picture of another size refused the folder."""
    caplog.set_level(logging.WARNING)
    pictures = lens_images([_write_sizes(tmp_path, [(81, 61), (80, 60), (80, 60), (81, 61), (80, 60)])])
    assert [picture.name for picture in pictures] == ["1.png", "2.png", "4.png"]
    assert "2 of 5 pictures are not used" in caplog.text
    assert "0.png (81 x 61), 3.png (81 x 61)" in caplog.text


def test_as_many_of_one_size_as_of_another_are_refused(tmp_path: Path) -> None:
    with naming(LensError, "81", "80"):
        lens_images([_write_sizes(tmp_path, [(81, 61), (80, 60)])])
