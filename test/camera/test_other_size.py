"""Images of another size than their lens is for."""

import pytest

from bodycam_ros.camera.other_size import mode_of_size


@pytest.mark.parametrize(
    ("size", "said"),
    [
        ((1280, 960), "the same shape, smaller: most likely another resolution"),
        ((3840, 2880), "the same shape, larger"),
        ((1920, 1080), "cuts the picture above and below, such as 16:9 in place of 4:3"),
        ((1440, 1440), "cuts the picture at the sides"),
        ((1440, 1920), "height for width"),
    ],
)
def test_the_shape_tells_the_mode(size: tuple[int, int], said: str) -> None:
    assert said in mode_of_size((1920, 1440), size)
