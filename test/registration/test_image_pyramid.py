"""Pyramids: halves of an image in one array of bytes."""

import cv2
import numpy as np
import pytest

from bodycam_ros.registration.map_photographs import LEVELS, pyramid_levels, pyramid_size, write_pyramid


@pytest.mark.parametrize(("height", "width"), [(480, 640), (427, 641), (17, 33)])
def test_each_level_is_half_of_the_one_before_and_lies_behind_it(height: int, width: int) -> None:
    image = np.random.default_rng(1).integers(0, 256, (height, width)).astype(np.uint8)
    levels = pyramid_levels(height, width)
    assert len(levels) == LEVELS
    guarded = np.full(pyramid_size(levels) + 1, 7, np.uint8)
    guarded[-1] = 99
    write_pyramid(image, levels, guarded[:-1])
    end = 0
    for start, rows, columns in levels.tolist():
        assert start == end
        end = start + rows * columns
        np.testing.assert_array_equal(guarded[start:end].reshape(rows, columns), image)
        image = cv2.pyrDown(image)
    assert end == pyramid_size(levels) and guarded[-1] == 99
