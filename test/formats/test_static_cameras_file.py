"""Files of static cameras: what is written is read, and what is wrong is said."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import LensError, MapError, StaticCameraError
from bodycam_ros.formats.static_cameras_file import MARK, read_static_cameras, write_static_cameras
from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.static_camera import StaticCamera

K = [470.0, 0.0, 318.3, 0.0, 471.0, 240.7, 0.0, 0.0, 1.0]
STANDS = exp_se3(np.array([0.3, -1.2, 0.8, 2.5, -0.1, 1.25]))
BOARD_STANDS_UPRIGHT = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]


def pinhole(name: str) -> CameraModel:
    return camera_from_info(name, 640, 480, "plumb_bob", [-0.03, 0.01, 0.0, 0.0, 0.0], K)


def fisheye(name: str) -> CameraModel:
    return camera_from_info(name, 800, 600, "equidistant", [0.1, -0.02, 0.003, 1e-9], K)


def entry(frame: str = "T_board_cam", **changes: object) -> dict[str, Any]:
    """A camera as files of others have it; a field that becomes None is left out."""
    fields = {
        frame: STANDS.tolist(),
        "width": 640,
        "height": 480,
        "distortion_model": "plumb_bob",
        "D": [-0.03, 0.01, 0.0, 0.0, 0.0],
        "K": K,
        "R": np.eye(3).ravel().tolist(),
    }
    return {name: value for name, value in (fields | changes).items() if value is not None}


@pytest.fixture
def written(tmp_path: Path) -> Callable[[Any], Path]:
    def write(document: Any) -> Path:
        path = tmp_path / "cameras.yaml"
        path.write_text(document if isinstance(document, str) else yaml.safe_dump(document))
        return path

    return write


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


def with_board(reference_map: ReferenceMap, axes: Any) -> ReferenceMap:
    return replace(reference_map, summary={**reference_map.summary, "map_R_board": axes})


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cameras.yaml"
    cameras = [pinhole("door"), fisheye("ceiling")]
    poses = [STANDS, STANDS @ STANDS]
    write_static_cameras(path, [StaticCamera(c.name, T, c) for c, T in zip(cameras, poses, strict=True)])
    assert path.read_text().startswith(MARK)
    read = read_static_cameras(path)
    assert list(read) == ["door", "ceiling"]
    for camera, pose in zip(cameras, poses, strict=True):
        station = read[camera.name]
        assert station.name == station.camera.name == camera.name
        np.testing.assert_allclose(station.world_T_camera, pose, atol=1e-12)
        assert type(station.camera) is type(camera)
        assert station.camera.distortion == camera.distortion and station.camera.k == camera.k
        assert (station.camera.width, station.camera.height) == (camera.width, camera.height)


@pytest.mark.parametrize("frame", ["T_board_cam", "T_map_cam"])
def test_without_a_map_the_world_is_the_frame_of_the_file(written: Callable[[Any], Path], frame: str) -> None:
    station = read_static_cameras(written({"ext_00": entry(frame)}))["ext_00"]
    np.testing.assert_allclose(station.world_T_camera, STANDS, atol=1e-12)


@pytest.mark.parametrize(("axes", "turned"), [(None, np.eye(3)), (BOARD_STANDS_UPRIGHT, BOARD_STANDS_UPRIGHT)])
def test_a_board_that_stands_is_not_the_frame_of_the_map(
    written: Callable[[Any], Path], reference_map: ReferenceMap, axes: Any, turned: Array
) -> None:
    path = written({"ext_00": entry()})
    in_map = reference_map if axes is None else with_board(reference_map, axes)
    expected = np.eye(4)
    expected[:3, :3] = turned
    np.testing.assert_allclose(
        read_static_cameras(path, in_map)["ext_00"].world_T_camera, expected @ STANDS, atol=1e-12
    )
    path = written({"ext_00": entry("T_map_cam")})
    np.testing.assert_allclose(read_static_cameras(path, in_map)["ext_00"].world_T_camera, STANDS, atol=1e-12)


def test_a_map_without_a_board_has_no_place_for_the_frame_of_one(
    written: Callable[[Any], Path], reference_map: ReferenceMap
) -> None:
    path = written({"ext_00": entry()})
    of_before = replace(reference_map, summary={"board_residual": None})
    for boardless in (with_board(reference_map, None), of_before):
        with naming(StaticCameraError, path):
            read_static_cameras(path, boardless)
    for damaged in ([[1.0, 0.0], [0.0, 1.0]], np.diag([1.0, 1.0, -1.0]).tolist(), "up", [[np.nan] * 3] * 3):
        with naming(MapError, "map_R_board"):
            read_static_cameras(path, with_board(reference_map, damaged))


SHEARED = STANDS.copy()
SHEARED[0, 1] += 0.1
MIRRORED = STANDS @ np.diag([1.0, 1.0, -1.0, 1.0])
FAR = STANDS.copy()
FAR[0, 3] = 2500.0
NOT_FINITE = STANDS.copy()
NOT_FINITE[1, 3] = np.nan


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ({}, ()),
        ("", ()),
        ("ext_00: {", ()),
        ("ext_00: 1\next_00: 2", ()),
        ({"ext_00": 5}, ("camera 'ext_00'",)),
        ({7: entry()}, ("camera 7",)),
        ({"ext_00": entry(K=None, D=None)}, ("camera 'ext_00'", "D", "K")),
        ({"ext_00": entry(T_board_cam=None)}, ("camera 'ext_00'", "T_map_cam")),
        ({"ext_00": entry(T_map_cam=STANDS.tolist())}, ("T_map_cam",)),
        ({"a": entry(), "b": entry("T_map_cam")}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=[[1, 0], [0, 1]])}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=NOT_FINITE.tolist())}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=STANDS[:, [3, 0, 1, 2]].tolist())}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=SHEARED.tolist())}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=MIRRORED.tolist())}, ("T_board_cam",)),
        ({"ext_00": entry(T_board_cam=FAR.tolist())}, ("T_board_cam",)),
        ({"ext_00": entry(width=640.5)}, ("width",)),
    ],
)
def test_what_is_wrong_is_said_with_file_and_camera(
    written: Callable[[Any], Path], document: Any, named: tuple[str, ...]
) -> None:
    path = written(document)
    with naming(StaticCameraError, path, *named):
        read_static_cameras(path)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"distortion_model": "thin_lens"}, ("thin_lens",)),
        ({"D": [0.1]}, ("plumb_bob",)),
        ({"D": "none"}, ()),
        ({"K": [0.0] * 9}, ()),
        ({"width": 0}, ()),
    ],
)
def test_a_lens_that_is_none_is_refused(
    written: Callable[[Any], Path], changes: dict[str, object], named: tuple[str, ...]
) -> None:
    with naming(LensError, "cameras.yaml", "ext_00", *named):
        read_static_cameras(written({"ext_00": entry(**changes)}))
