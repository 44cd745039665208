"""Lines across contours against a twin in NumPy, and against edges whose place is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from outside.numpy_regions import Front, areas_in_numpy, ask_in_numpy, colours_at, count_in_numpy, lines_in_numpy
from outside.painted_scene import clutter, grained, opencv_pixels

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import exp_se3, exp_so3, rigid, transform_points
from bodycam_ros.outside.contour_kernels import NOBODY, POINT
from bodycam_ros.outside.region_kernels import COLOURS, ask_lines, count_areas, count_colours

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

WIDTH, HEIGHT, SHRINK, LEAST_PX = 160, 120, 2, 0.7
RED, GREEN = (40, 30, 200), (60, 180, 50)
CAMERA = camera_from_info(
    "small", WIDTH, HEIGHT, "plumb_bob", [-0.06, 0.02, 0, 0, 0], [140, 0, 79, 0, 141, 60, 0, 0, 1]
)

TURNED = rigid(exp_so3(np.array([0.3, -0.5, 0.2])), np.array([0.1, 0.0, 2.0]))


def points_at(pixels: Array, normals: Array, camera_T_segment: Array) -> Array:
    """(N, POINT) contour points two metres before the camera."""
    inverse_K = np.linalg.inv(np.array(CAMERA.k).reshape(3, 3))
    in_camera = 2.0 * np.column_stack([pixels, np.ones(len(pixels))]) @ inverse_K.T  # near the middle of the lens
    points = np.zeros((len(pixels), POINT))
    points[:, 2:4] = normals
    points[:, 4:7] = transform_points(np.linalg.inv(camera_T_segment), in_camera)
    points[:, :2] = points[:, 10:12] = pixels
    for axis in range(3):
        ends = [
            opencv_pixels(CAMERA, transform_points(camera_T_segment, points[:, 4:7] + h * np.eye(3)[axis]))
            for h in (1e-6, -1e-6)
        ]
        points[:, 7 + axis] = ((ends[0] - ends[1]) / 2e-6 * normals).sum(axis=1)
    return points


def scattered(count: int, seed: int) -> tuple[Array, NDArray[np.int64]]:
    """Points all over the image and beyond its borders, of three segments, found some pixels from where they are."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    pixels = random.uniform([-3, -3], [WIDTH + 3, HEIGHT + 3], (count, 2))
    points = points_at(pixels, np.column_stack([np.cos(angle), np.sin(angle)]), TURNED)
    points[:, 10:12] += random.normal(0.0, 3.0, (count, 2))
    return points, random.integers(0, 3, count)


def odds_of(inside: tuple[int, int, int], outside: tuple[int, int, int]) -> NDArray[np.float32]:
    """(1, COLOURS) for colours that are on one side alone."""
    odds = np.zeros((1, COLOURS), np.float32)
    for colour, value in ((inside, 6.0), (outside, -6.0)):
        odds[0, colours_at(np.array([[colour]], np.uint8), np.zeros((1, 2)))] = value
    return odds


def half_plane(normal: Array, place: float) -> Image:
    """Red where normal . pixel is below a place, green beyond: the border of pixels that are one or the other."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.where(((x * normal[0] + y * normal[1]) < place)[..., None], RED, GREEN).astype(np.uint8)


def front_of(inside: NDArray[np.bool_]) -> Front:
    """One segment in front where a mask (H, W) says so."""
    labels = np.where(inside[::SHRINK, ::SHRINK], 0, NOBODY).astype(np.uint8)
    return Front(labels, SHRINK, np.zeros((1, 1), np.uint8), NOBODY)


def behind(pixel: Array, normal: Array) -> Front:
    """One segment that ends at a pixel, as far as its pose is known."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return front_of((x - pixel[0]) * normal[0] + (y - pixel[1]) * normal[1] < 0.0)


def asked(
    image: Image, front: Front, points: Array, segments: NDArray[np.int64], odds: NDArray[np.float32], stride: int
) -> tuple[Array, Array, NDArray[np.int64]]:
    return ask_lines(
        image, front.labels, front.shrink, points, segments, front.stands_out, odds, stride, LEAST_PX
    )  # fmt: skip


def one_line(
    image: Image, pixel: Array, normal: Array, odds: NDArray[np.float32], stride: int, front: Front | None = None
) -> tuple[float, float] | None:
    """Mean and sigma [px] of a line across a pixel, if it knows something."""
    point = np.zeros((1, POINT))
    point[0, :4], point[0, 7], point[0, 10:12] = [*pixel, *normal], 1.0, pixel
    front = front or behind(pixel, normal)
    information, vector, lines = asked(image, front, point, np.zeros(1, np.int64), odds, stride)
    if not lines[0]:
        assert not information.any() and not vector.any()
        return None
    return vector[0, 3] / information[0, 3, 3], information[0, 3, 3] ** -0.5


def blocks(seed: int) -> Front:
    """Three segments and nobody in blocks, some of which stand out before others."""
    chosen = np.random.default_rng(seed).choice([0, 1, 2, NOBODY], (HEIGHT // SHRINK // 15, WIDTH // SHRINK // 20))
    labels = np.ascontiguousarray(chosen.repeat(15, axis=0).repeat(20, axis=1), np.uint8)
    return Front(labels, SHRINK, np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]], np.uint8), NOBODY)


@pytest.mark.parametrize("stride", [1, 2, 3, 4])
def test_lines_are_those_of_the_numpy_twin(stride: int) -> None:
    points, segments = scattered(300, 1)
    random = np.random.default_rng(2)
    odds = random.normal(0.0, 2.5, (3, COLOURS)).astype(np.float32)
    image = clutter(WIDTH, HEIGHT, 3)
    front = blocks(10)
    ours = asked(image, front, points, segments, odds, stride)
    theirs = ask_in_numpy(image, front, points, segments, odds, stride, LEAST_PX)
    assert 0 < ours[2].min() and ours[2].sum() < len(points)  # some know nothing
    np.testing.assert_array_equal(ours[2], theirs[2])
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-8, atol=1e-8 * np.abs(theirs[0]).max())
    np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-8, atol=1e-8 * np.abs(theirs[1]).max())


def test_colours_are_those_of_the_numpy_twin() -> None:
    points, segments = scattered(400, 4)
    front, image = blocks(5), clutter(WIDTH, HEIGHT, 6)
    ours = count_colours(image, front.labels, SHRINK, points, segments, front.stands_out, 9, 14)
    theirs = count_in_numpy(image, front, points, segments, 9, 14)
    for side in range(2):
        assert (ours[side].sum(axis=1) > 100).all()
        np.testing.assert_array_equal(ours[side], theirs[side])
    areas = count_areas(image, front.labels, SHRINK, 3)
    assert (areas.sum(axis=1) > 100).all()
    np.testing.assert_array_equal(areas, areas_in_numpy(image, front))


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
        assert LEAST_PX < found[1] < LEAST_PX + 1.3 * stride


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


def test_a_plain_image_says_nothing() -> None:
    """Nor does one whose colours are as likely on both sides, or which are all the segment's, or all that are not."""
    middle, right = np.array([80.0, 60.0]), np.array([1.0, 0.0])
    plain = np.full((HEIGHT, WIDTH, 3), RED, np.uint8)
    for image, odds in (
        (plain, odds_of(RED, GREEN)),
        (plain, odds_of(GREEN, RED)),
        (plain, np.zeros((1, COLOURS), np.float32)),
        (clutter(WIDTH, HEIGHT, 1), np.zeros((1, COLOURS), np.float32)),
    ):
        assert one_line(image, middle, right, odds, 1) is None
    # An edge that is the wrong way round is none.
    wrong = one_line(half_plane(right, 80.5), middle, -right, odds_of(RED, GREEN), 1)
    assert wrong is None or wrong[1] > 2.0


def test_beyond_a_thin_limb_colours_say_nothing() -> None:
    """What lies beyond its far side looks like it, and would be taken for it; nor do lines see through others."""
    middle, right = np.array([80.0, 60.0]), np.array([1.0, 0.0])
    x = np.mgrid[:HEIGHT, :WIDTH][1]
    image, odds = half_plane(right, 80.5), odds_of(RED, GREEN)
    whole = one_line(image, middle, right, odds, 1, front_of(x < 80))
    thin = front_of((x >= 70) & (x < 80))
    image[:, :70] = GREEN  # as seen beside the limb
    beside = one_line(image, middle, right, odds, 1, thin)
    image[:, :70] = np.random.default_rng(1).integers(0, 255, (HEIGHT, 70, 3))
    noisy = one_line(image, middle, right, odds, 1, thin)
    assert whole is not None and beside is not None and beside == noisy
    assert beside[0] == pytest.approx(whole[0], abs=0.3)
    # Where something that looks alike begins four pixels on, the place of an edge beyond it is unknown.
    labels = thin.labels.copy()
    labels[:, 84 // SHRINK :] = 1
    two = np.repeat(odds, 2, axis=0)
    far = half_plane(right, 90.5)
    hidden = Front(labels, SHRINK, np.zeros((2, 2), np.uint8), NOBODY)
    seen = Front(labels, SHRINK, np.ones((2, 2), np.uint8), NOBODY)
    open_end, told = (one_line(far, middle, right, two, 2, front) for front in (hidden, seen))
    assert told is not None and told[0] == pytest.approx(10.5, abs=1.5)
    assert open_end is None or open_end[1] > 1.3 * told[1]


def test_a_line_that_is_less_sure_counts_less() -> None:
    middle, right = np.array([80.0, 60.0]), np.array([1.0, 0.0])
    image = half_plane(right, 80.5)
    sigmas = [one_line(image, middle, right, share * odds_of(RED, GREEN), 1) for share in (1.0, 0.15, 0.1)]
    known = [found[1] for found in sigmas if found is not None]
    assert len(known) == 3 and known == sorted(known) and known[2] > 1.2 * known[0]


def test_colours_that_were_counted_find_the_edge() -> None:
    """From counts to means, with the grain of a sensor."""
    random, right = np.random.default_rng(8), np.array([1.0, 0.0])
    image = grained(half_plane(right, 80.5), random)
    labels = np.full((HEIGHT // SHRINK, WIDTH // SHRINK), NOBODY, np.uint8)
    labels[:, : 81 // SHRINK] = 0
    rows = np.arange(10.0, 110.0, 0.5)
    points = points_at(np.column_stack([np.full(len(rows), 80.5), rows]), np.tile(right, (len(rows), 1)), TURNED)
    segments, stands_out = np.zeros(len(rows), np.int64), np.zeros((1, 1), np.uint8)
    counts = count_colours(image, labels, SHRINK, points, segments, stands_out, 12, 20)
    share = [count / count.sum() + 1e-4 for count in counts]
    odds = np.log(share[0] / share[1]).astype(np.float32)
    shifted = points.copy()
    off = 3.0 + random.uniform(-0.5, 0.5, len(rows))  # a pixel is one colour, so a line alone is half a pixel off
    shifted[:, 0] -= off
    front = Front(labels, SHRINK, stands_out, NOBODY)
    means = [line.mean for line in lines_in_numpy(image, front, shifted, segments, odds, 1)]
    assert len(means) == len(rows)
    assert np.mean(means - off) == pytest.approx(0.0, abs=0.1)
    assert np.std(means - off) < 0.5


def test_the_vector_is_the_slope_of_what_the_lines_say() -> None:
    """Of half the sum of (movement along the normal - mean)^2 / variance, with movement by OpenCV's lens."""
    random = np.random.default_rng(9)
    angle = random.uniform(0.0, 2.0 * np.pi, 80)
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    pixels = np.array([79.0, 60.0]) + 35.0 * normals + random.normal(0.0, 1.0, normals.shape)
    points, segments = points_at(pixels, normals, TURNED), np.zeros(80, np.int64)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside = ((x - 81.0) ** 2 / 36.0**2 + (y - 58.0) ** 2 / 34.0**2) < 1.0
    image = grained(np.where(inside[..., None], RED, GREEN).astype(np.uint8), random)
    odds = random.normal(0.0, 0.2, (1, COLOURS)).astype(np.float32)
    colours = np.unique(colours_at(image, np.column_stack([x[inside], y[inside]]).astype(float)))
    odds[0] -= 2.0
    odds[0, colours] += 4.0
    front = front_of((x - 79.0) ** 2 + (y - 60.0) ** 2 < 35.0**2)
    known = list(lines_in_numpy(image, front, points, segments, odds, 2))
    assert len(known) > 60
    rows = np.array([line.row for line in known])
    means = np.array([line.mean for line in known])
    weights = 1.0 / (np.array([line.variance for line in known]) + LEAST_PX**2)
    start = opencv_pixels(CAMERA, transform_points(TURNED, points[rows, 4:7]))

    def half_squares(change: Array, means: Array) -> float:
        there = opencv_pixels(CAMERA, transform_points(TURNED @ exp_se3(change[None])[0], points[rows, 4:7]))
        return float(0.5 * (weights * (((there - start) * normals[rows]).sum(axis=1) - means) ** 2).sum())

    information, vector, lines = asked(image, front, points, segments, odds, 2)
    assert lines[0] == len(known)
    h = 1e-5
    for axis in np.eye(6):
        slope = (half_squares(h * axis, means) - half_squares(-h * axis, means)) / (2.0 * h)
        assert -slope == pytest.approx(axis @ vector[0], abs=1e-3 * np.abs(vector).max())
    for direction in random.normal(size=(8, 6)):
        bend = half_squares(h * direction, 0.0 * means) / (0.5 * h**2)
        assert bend == pytest.approx(direction @ information[0] @ direction, rel=1e-3)
