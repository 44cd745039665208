"""Lines across contours against edges whose place is known."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.static_cameras.contour_kernels import NOBODY, POINT
from bodycam_ros.static_cameras.region_kernels import BINS, COLOURS, measure_lines

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

WIDTH = 160
HEIGHT = 120
SHRINK = 2
LEAST_PX = 0.7
RED, GREEN = (40, 30, 200), (60, 180, 50)


class Front(NamedTuple):
    """Labels (h, w) of the segments in front, how many pixels one label covers, who stands out before whom (S, S)."""

    labels: Image
    shrink: int
    stands_out: Image


def colour_bin(colour: tuple[int, int, int]) -> int:
    blue, green, red = (value * BINS // 256 for value in colour)
    return (blue * BINS + green) * BINS + red


def odds_of(inside: tuple[int, int, int], outside: tuple[int, int, int]) -> NDArray[np.float32]:
    """(1, COLOURS) for colours that are on one side alone."""
    odds = np.zeros((1, COLOURS), np.float32)
    for colour, value in ((inside, 6.0), (outside, -6.0)):
        odds[0, colour_bin(colour)] = value
    return odds


def half_plane(normal: Array, place: float) -> Image:
    """Red where normal . pixel is below a place, green beyond: the border of pixels that are one or the other."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.where(((x * normal[0] + y * normal[1]) < place)[..., None], RED, GREEN).astype(np.uint8)


def front_of(inside: NDArray[np.bool_]) -> Front:
    """One segment in front where a mask (H, W) says so."""
    labels = np.where(inside[::SHRINK, ::SHRINK], 0, NOBODY).astype(np.uint8)
    return Front(labels, SHRINK, np.zeros((1, 1), np.uint8))


def behind(pixel: Array, normal: Array) -> Front:
    """One segment that ends at a pixel, as far as its pose is known."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return front_of((x - pixel[0]) * normal[0] + (y - pixel[1]) * normal[1] < 0.0)


def asked(
    image: Image, front: Front, points: Array, segments: NDArray[np.int64], odds: NDArray[np.float32], stride: int
) -> tuple[Array, Array, NDArray[np.int64], Array, Array]:
    return measure_lines(
        image, front.labels, front.shrink, points, segments, front.stands_out, odds, stride, LEAST_PX
    )  # fmt: skip


def one_line(
    image: Image, pixel: Array, normal: Array, odds: NDArray[np.float32], stride: int, front: Front | None = None
) -> tuple[float, float] | None:
    """Mean and sigma [px] of a line across a pixel, if it knows something."""
    point = np.zeros((1, POINT))
    point[0, :4], point[0, 7], point[0, 10:12] = [*pixel, *normal], 1.0, pixel
    front = front or behind(pixel, normal)
    information, vector, lines, _, _ = asked(image, front, point, np.zeros(1, np.int64), odds, stride)
    if not lines[0]:
        assert not information.any() and not vector.any()
        return None
    return vector[0, 3] / information[0, 3, 3], information[0, 3, 3] ** -0.5


@pytest.mark.parametrize("stride", [1, 2, 4])
@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0, 33.0, 260.0])
def test_a_line_finds_an_edge_that_is_displaced(stride: int, degrees: float) -> None:
    normal = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    odds = odds_of(RED, GREEN)
    for displaced in stride * np.array([-4.5, -2.0, -0.4, 0.0, 1.0, 2.7, 4.5]):
        pixel = np.array([80.0, 60.0])
        found = one_line(half_plane(normal, pixel @ normal + displaced), pixel, normal, odds, stride)
        assert found is not None
        assert found[0] == pytest.approx(displaced, abs=0.5 * stride + 0.35)
        # Cauchy's weight of a line that is displaced by three samples is a half.
        sigma = found[1] / np.hypot(1.0, displaced / (3.0 * stride))
        assert LEAST_PX < sigma < LEAST_PX + 1.3 * stride


def test_an_edge_between_pixels_is_found_between_them() -> None:
    """Without a bias: half a pixel more would be 3 mm of a person four metres away."""
    odds = odds_of(RED, GREEN)
    image = half_plane(np.array([1.0, 0.0]), 79.5)  # up to and with pixel 79
    for x, sign in ((80.0, 1.0), (76.0, 1.0), (82.0, 1.0)):
        ahead = one_line(image, np.array([x, 60.0]), np.array([sign, 0.0]), odds, 1)
        back = one_line(image, np.array([x, 60.0]), np.array([-sign, 0.0]), -odds, 1)
        assert ahead is not None and back is not None
        assert ahead[0] == pytest.approx(79.5 - x, abs=0.02)
        assert back[0] == pytest.approx(x - 79.5, abs=0.02)
