"""The way of the sample's walk on a photograph of its map, and from above."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.cli.main import main
from bodycam_ros.errors import MapError
from bodycam_ros.evaluate.way_picture import best_photograph, draw_way, pixels_in_photograph, way_on_ground
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="module")
def recording(sample_out: Path) -> SolvedRecording:
    return read_solved(sample_out)


def test_the_way_is_below_the_root_as_high_as_the_feet_stand(recording: SolvedRecording) -> None:
    way = way_on_ground(recording)
    root = recording.world_T_segment[:, recording.body.segment_index["pelvis"], :3, 3]
    np.testing.assert_allclose(way[:, :2], root[:, :2])
    assert abs(way[0, 2]) < 0.05, "the board of the map lies on the floor, at z = 0"


def test_pixels_are_where_opencv_projects_them(reference_map: ReferenceMap, recording: SolvedRecording) -> None:
    way = way_on_ground(recording)
    row = best_photograph(reference_map, way)
    assert row is not None and reference_map.photographs is not None
    pixels = pixels_in_photograph(reference_map, row, way)
    assert np.isfinite(pixels).all(), "all of a short way is in one photograph"
    lens = reference_map.photographs.cameras[reference_map.photographs.camera_of_view[row]]
    camera_T_world = inverse(reference_map.world_T_camera[row])
    K = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    turn, shift = cv2.Rodrigues(camera_T_world[:3, :3])[0], camera_T_world[:3, 3]
    project = {"plumb_bob": cv2.projectPoints, "equidistant": cv2.fisheye.projectPoints}[lens.distortion_model]
    expected, _ = project(way[:, None].copy(), turn, shift, K, np.array(lens.distortion))
    np.testing.assert_allclose(pixels, expected.reshape(-1, 2), atol=1e-3)


def test_a_way_that_no_photograph_shows_is_drawn_from_above_alone(
    reference_map: ReferenceMap, recording: SolvedRecording, tmp_path: Path
) -> None:
    way = way_on_ground(recording)
    assert best_photograph(reference_map, np.full_like(way, np.nan)) is None
    bare = replace(reference_map, photographs=None)
    assert best_photograph(bare, way) is None
    draw_way(recording, bare, tmp_path / "way.png")
    assert cv2.imread(str(tmp_path / "way.png")) is not None


@pytest.mark.parametrize("content", [b"no picture", b""])
def test_a_damaged_photograph_is_named(
    reference_map: ReferenceMap, recording: SolvedRecording, tmp_path: Path, content: bytes
) -> None:
    photographs = reference_map.photographs
    assert photographs is not None
    damaged = replace(photographs, jpegs=tuple(content for _ in photographs.jpegs))
    with naming(MapError, "ref_0044.jpg"):
        draw_way(recording, replace(reference_map, photographs=damaged), tmp_path / "way.png")
    assert not (tmp_path / "way.png").exists()


def test_the_report_has_the_way(sample: Path, sample_out: Path, tmp_path: Path) -> None:
    report = tmp_path / "report"
    assert main(["evaluate", str(sample_out), "--map", str(sample / "map"), "-o", str(report)]) == 0
    assert cv2.imread(str(report / "way.png")).shape[1] > 1000
    assert "over the photograph of the map that shows most of it" in (report / "report.html").read_text()
