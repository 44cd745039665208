"""Pictures of a lens are of one size; what has another is named."""

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from bodycam_ros.errors import LensError
from bodycam_ros.lens.lens_images import lens_images


def write(folder: Path, sizes: list[tuple[int, int]]) -> Path:
    for number, (width, height) in enumerate(sizes):
        cv2.imwrite(str(folder / f"{number}.png"), np.full((height, width), 90, np.uint8))
    return folder


def test_pictures_of_the_size_that_most_have_are_taken(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A first picture of another size refused the folder."""
    caplog.set_level(logging.WARNING)
    pictures = lens_images([write(tmp_path, [(81, 61), (80, 60), (80, 60), (81, 61), (80, 60)])])
    assert [picture.name for picture in pictures] == ["1.png", "2.png", "4.png"]
    assert "2 of 5 pictures are left out" in caplog.text
    assert "0.png (81 x 61), 3.png (81 x 61)" in caplog.text


def test_as_many_of_one_size_as_of_another_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LensError, match="give pictures of one size"):
        lens_images([write(tmp_path, [(81, 61), (80, 60)])])
