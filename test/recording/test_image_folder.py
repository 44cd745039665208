"""Times of images in a folder: by stamps in their names, else by a rate."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.image_folder import ImageFolder

START_NS, STEP_NS = 999_999_950_000_000_000, 33_333_333  # of 18 digits, then 19


def images(folder: Path, *names: str) -> list[Path]:
    paths = [folder / name for name in names]
    for path in paths:
        assert cv2.imwrite(str(path), np.zeros((4, 6), np.uint8))
    return sorted(paths)


def test_stamps_in_names_are_the_times_in_any_number_of_digits(tmp_path: Path) -> None:
    paths = images(tmp_path, *(f"{START_NS + STEP_NS * number}.png" for number in range(4)))
    folder = ImageFolder.from_files("head", paths, None)
    assert folder.times_s == pytest.approx([0.0, 0.033333333, 0.066666666, 0.099999999])
    assert [int(path.stem) - START_NS for path in folder.paths] == [STEP_NS * number for number in range(4)]
    assert folder.facts.created is not None and folder.facts.created.year == 2001


def test_an_image_twice_is_named(tmp_path: Path) -> None:
    paths = images(tmp_path, f"{START_NS}.png", f"{START_NS}.jpg", f"{START_NS + STEP_NS}.png")
    with naming(RecordingError, tmp_path / f"{START_NS}.jpg", f"{START_NS}.png"):
        ImageFolder.from_files("head", paths, None)


@pytest.mark.parametrize("first", [20241129123456000, 20241129123456000000000], ids=["date", "larger than any stamp"])
def test_other_numbers_are_no_stamps_and_need_a_rate(tmp_path: Path, first: int) -> None:
    paths = images(tmp_path, *(f"{first + 33 * number}.png" for number in range(3)))
    with naming(RecordingError, tmp_path, "--rate"):
        ImageFolder.from_files("head", paths, None)
    assert ImageFolder.from_files("head", paths, 30.0).times_s == pytest.approx([0.0, 1 / 30, 2 / 30])
