"""The contour of a painted person, and what the lines across it say, against a twin and against poses that are off."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from outside.dressed_body import DressedBody, small_motion, stations_around
from outside.numpy_regions import Front, lines_in_numpy
from outside.painted_scene import clutter

from bodycam_ros.body.body_file import read_body
from bodycam_ros.geometry import rigid
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.contour_kernels import NOBODY, POINT
from bodycam_ros.outside.contour_painting import CONTOUR, INWARD, OUTWARD, SILENT, Window, bgr, paint_contour
from bodycam_ros.outside.region_kernels import COLOURS, line_shifts
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.region_tracker import RegionTracker
from bodycam_ros.outside.seen_contour import SeenContour
from bodycam_ros.outside.station_view import StationView

Array = NDArray[np.float64]
Image = NDArray[np.uint8]


@pytest.mark.parametrize("stride", [1, 3])
def test_shifts_are_those_of_the_numpy_twin(stride: int) -> None:
    random = np.random.default_rng(8)
    image = clutter(160, 120, 3)
    angle = random.uniform(0.0, 2.0 * np.pi, 200)
    points = np.zeros((200, POINT))
    points[:, :2] = random.uniform([-3, -3], [163, 123], (200, 2))
    points[:, 2:4] = np.column_stack([np.cos(angle), np.sin(angle)])
    segments = random.integers(0, 3, 200)
    blocks = random.choice([0, 1, 2, NOBODY], (4, 4)).repeat(15, axis=0).repeat(20, axis=1)
    front = Front(np.ascontiguousarray(blocks, np.uint8), 2, np.triu(np.ones((3, 3), np.uint8), 1), NOBODY)
    odds = random.normal(0.0, 2.5, (3, COLOURS)).astype(np.float32)
    shifts, _ = line_shifts(image, front.labels, 2, points, segments, front.stands_out, odds, stride)
    expected = np.full(200, np.nan)
    for line in lines_in_numpy(image, front, points, segments, odds, stride):
        expected[line.row] = line.mean
    assert 0 < np.isnan(expected).sum() < 200
    np.testing.assert_allclose(shifts, expected, rtol=1e-8, atol=1e-8)


@pytest.fixture(scope="module")
def seen(sample: Path) -> tuple[StationView, Image, Array]:
    """A station that has learned a person's colours, its image, and where the person is."""
    body = read_body(sample / "body.yaml")
    dressed = DressedBody(body, capsule_surfaces(body), stations_around(1))
    (poses,) = small_motion(body, 1)
    image = dressed.images(poses, 1.0, 0)["ext_00"]
    surface = BodySurface.of(body, dressed.surfaces)
    view = RegionTracker(body, surface, dressed.stations, RegionSettings()).views["ext_00"]
    view.learn(image, view.contour(poses), 1.0, np.ones(len(poses), bool))
    return view, image, poses


def test_where_the_body_is_nothing_moves_the_contour(seen: tuple[StationView, Image, Array]) -> None:
    view, image, poses = seen
    contour = view.seen_contour(image, view.contour(poses))
    told = np.isfinite(contour.shifts)
    assert told.mean() > 0.9
    assert np.median(np.abs(contour.shifts[told])) < 1.0
    np.testing.assert_allclose(np.linalg.norm(contour.normals, axis=1), 1.0)
    low, high = contour.covered
    assert ((contour.pixels > low - 3.0) & (contour.pixels < high + 3.0)).all()
    assert (high - low).max() > 100


def test_forces_point_back_to_where_the_body_is(seen: tuple[StationView, Image, Array]) -> None:
    """It is taken for two centimetres further to the image's right than it is: 3 px."""
    view, image, poses = seen
    moved = rigid(np.eye(3), 0.02 * view.station.world_T_camera[:3, 0]) @ poses
    contour = view.seen_contour(image, view.contour(moved))
    across = np.abs(contour.normals[:, 0]) > 0.9
    steps = (contour.shifts * contour.normals[:, 0])[across & np.isfinite(contour.shifts)]
    assert len(steps) > 30
    assert -4.5 < np.median(steps) < -1.5
    right = across & (contour.normals[:, 0] > 0.0)
    assert np.nanmedian(contour.shifts[right]) < -1.0  # inward there, and outward at the left
    assert np.nanmedian(contour.shifts[across & ~right]) > 1.0


def test_points_and_forces_are_painted_in_their_colours_where_they_are() -> None:
    labels = np.full((50, 50), NOBODY, np.uint8)
    labels[10:40, 10:40] = 0
    contour = SeenContour(
        pixels=np.array([[20.0, 50.0], [79.0, 50.0], [50.0, 79.0]]),
        normals=np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
        segments=np.zeros(3, np.int64),
        shifts=np.array([2.0, -2.0, np.nan]),
        labels=labels,
        shrink=2,
    )
    picture = paint_contour(np.full((100, 100, 3), 100, np.uint8), contour, ["#0000ff"], Window(5, 10, 100, 90, 4))
    assert picture.shape == (360, 400, 3)

    def at(x: float, y: float) -> list[int]:
        column, row = round((x - 5 + 0.5) * 4 - 0.5), round((y - 10 + 0.5) * 4 - 0.5)
        return picture[row, column].tolist()

    assert [at(20, 50), at(79, 50), at(50, 79)] == [list(bgr(c)) for c in (CONTOUR, CONTOUR, SILENT)]
    assert at(14, 50) == list(bgr(OUTWARD)) and at(73, 50) == list(bgr(INWARD))
    assert at(11, 50) == [100, 100, 100]  # four times two pixels, and no further
    blue, green, red = at(50, 40)
    assert blue > 130 and green == red < 90
    assert at(90, 30) == [100, 100, 100] and at(103, 30) != [100, 100, 100]  # beyond the image's right border


def test_a_body_that_is_not_in_the_image_covers_nothing(seen: tuple[StationView, Image, Array]) -> None:
    view, image, poses = seen
    contour = view.seen_contour(image, view.contour(rigid(np.eye(3), np.array([0.0, 0.0, 30.0])) @ poses))
    assert contour.covered is None and not len(contour.shifts)
