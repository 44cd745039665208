"""What a person sees who places a body: the body in each camera's image, and the image of a pinhole camera."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from static_cameras.dressed_body import DressedBody, small_motion
from static_cameras.painted_bag import dressed_body

from bodycam_ros.body.surface import BodySurface
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.results.colours import rgb
from bodycam_ros.static_cameras.contour_painting import CONTOUR
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.viewer.placing_picture import PlacingPicture
from bodycam_ros.viewer.scene import SELECTED

TILE = 480


@pytest.fixture(scope="module")
def dressed(sample: Path) -> DressedBody:
    return dressed_body(sample)


@pytest.fixture(scope="module")
def poses(dressed: DressedBody) -> NDArray[np.float64]:
    return small_motion(dressed.body, 1)[0]


@pytest.fixture
def picture(dressed: DressedBody) -> PlacingPicture:
    body = dressed.body
    tracker = RegionTracker(body, BodySurface.of(body, dressed.surfaces), dressed.stations, RegionSettings())
    grey = {
        name: np.full((station.camera.height, station.camera.width, 3), 128, np.uint8)
        for name, station in dressed.stations.items()
    }
    return PlacingPicture(body, tracker.views, grey)


def near(tile: NDArray[np.uint8], colour: str) -> NDArray[np.float64]:
    """Columns and rows (N, 2) of pixels of a colour."""
    rows, columns = np.nonzero(np.abs(tile.astype(int) - rgb(colour)).max(axis=2) < 12)
    return np.stack([columns, rows], axis=1).astype(float)


@pytest.mark.parametrize("is_close_up", [False, True])
def test_contours_and_the_selected_joint_are_where_each_camera_has_them(
    picture: PlacingPicture, dressed: DressedBody, poses: NDArray[np.float64], is_close_up: bool
) -> None:
    picture.cut(is_close_up)
    drawn = picture.draw(poses, "shin_left")
    assert drawn.shape == (2 * TILE, 2 * TILE, 3)
    for number, (name, station) in enumerate(dressed.stations.items()):
        row, column = divmod(number, 2)
        tile = drawn[TILE * row : TILE * (row + 1), TILE * column : TILE * (column + 1)]
        window, _ = picture._parts[name]

        camera_T_segment = inverse(station.world_T_camera) @ poses
        found = near(tile, SELECTED)
        knee = camera_T_segment[None, dressed.body.segment_index["shin_left"], :3, 3]
        expected = window.place(station.camera.project(knee)[0])
        assert len(found) and np.abs(found - expected).max(axis=1).min() < 2.0
        outline = near(tile, CONTOUR)
        vertices = [
            transform_points(camera_T_segment[dressed.body.segment_index[segment]], surface.vertices)
            for segment, surface in dressed.surfaces.items()
        ]
        points = window.place(station.camera.project(np.concatenate(vertices))[0])
        assert len(outline) > 100
        for reached, edge in zip(
            (outline.min(axis=0), outline.max(axis=0)), (points.min(axis=0), points.max(axis=0)), strict=True
        ):
            assert np.abs(reached - edge).max() < 5.0
        height = np.ptp(points[:, 1])
        assert height > 0.6 * TILE if is_close_up else height < 0.6 * TILE
