"""The view of what static cameras follow: the body's surface, where they stand, and the contour in their images."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS, Walk, write_solved
from outside.dressed_body import DressedBody, stations_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.contour_painting import CONTOUR
from bodycam_ros.outside.hands import with_hands
from bodycam_ros.outside.stations_file import write_stations
from bodycam_ros.view.correction import BodyFile, Correction, Move, Part
from bodycam_ros.view.detail import FINE
from bodycam_ros.view.footage import Footage
from bodycam_ros.view.local_server import LocalServer
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.scene import Scene
from bodycam_ros.view.scene_nodes import rgb, segment_name
from bodycam_ros.view.sources import Sources
from bodycam_ros.view.station_scene import StationScene

STATIONS = stations_around(2)


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test")
    yield server
    server.stop()


@pytest.fixture
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture
def scene(server: LocalServer, body: BodyModel) -> Scene:
    return Scene(server, body, None, Motion.standing(body), lambda part: None, STATIONS, capsule_surfaces)


@pytest.fixture
def stations(tmp_path: Path) -> Path:
    write_stations(tmp_path / "cameras.yaml", STATIONS.values())
    return tmp_path / "cameras.yaml"


def _drawn(body: BodyModel, segment: str) -> Array:
    surface = capsule_surfaces(body)[segment]
    return FINE.mesh(surface.vertices, surface.faces)[0]


def test_the_surface_is_on_the_segments_and_can_be_hidden(server: LocalServer, scene: Scene, body: BodyModel) -> None:
    name = f"{segment_name('shin_left')}/surface"
    assert server.scene.get_handle_by_name(name) is None  # until somebody wants it
    scene.show_surface(body, True)
    mesh = server.scene.get_handle_by_name(name)
    np.testing.assert_allclose(mesh.vertices, _drawn(body, "shin_left"), atol=1e-6)
    assert mesh.visible and 0.0 < mesh.opacity < 1.0
    scene.show_surface(body, False)
    assert not mesh.visible
    scene.show_surface(body, True)
    assert mesh.visible and server.scene.get_handle_by_name(name) is mesh


def test_the_surface_is_out_of_the_way_of_a_correction_and_follows_it(
    server: LocalServer, scene: Scene, body: BodyModel
) -> None:
    knee, name = Part("joint", "knee_left"), f"{segment_name('thigh_left')}/surface"
    scene.show_surface(body, True)
    scene.select(body, knee)
    assert not server.scene.get_handle_by_name(name).visible
    longer = Correction(body).moved_by(knee, Move(np.array([0.0, 0.0, -50.0]), np.zeros(3))).body
    scene.reshape(longer)
    scene.select(longer, None)
    mesh = server.scene.get_handle_by_name(name)
    assert mesh.visible
    np.testing.assert_allclose(mesh.vertices, _drawn(longer, "thigh_left"), atol=1e-6)
    assert np.ptp(mesh.vertices[:, 2]) > np.ptp(capsule_surfaces(body)["thigh_left"].vertices[:, 2]) + 0.03


def test_hands_that_nobody_followed_end_the_forearms(server: LocalServer, scene: Scene, body: BodyModel) -> None:
    scene.show_surface(body, True)
    whole = with_hands(body)
    hand, forearm = (
        server.scene.get_handle_by_name(f"{segment_name('forearm_left')}/{n}") for n in ("hand", "surface")
    )
    length = np.ptp(capsule_surfaces(whole)["hand_left"].vertices[:, 2])
    assert hand.vertices[:, 2].min() == pytest.approx(forearm.vertices[:, 2].min() - length, abs=0.08)


def test_stations_stand_where_the_file_says(server: LocalServer, scene: Scene) -> None:
    for name, station in STATIONS.items():
        frustum = server.scene.get_handle_by_name(f"/world/stations/{name}")
        np.testing.assert_allclose(frustum.position, station.world_T_camera[:3, 3], atol=1e-6)
        assert frustum.fov == pytest.approx(2.0 * np.arctan(240.0 / 470.0))
        assert frustum.aspect == pytest.approx(640 / 480)
    scene.show_cameras(False)
    assert not server.scene.get_handle_by_name("/world/stations/ext_00").visible


def test_the_contour_is_drawn_into_a_stations_image(server: LocalServer, scene: Scene, body: BodyModel) -> None:
    poses = Motion.standing(body).segments_at(body, 0)
    image = DressedBody(body, capsule_surfaces(body), STATIONS).images(poses, 1.0, 0)["ext_01"]
    times = np.array([0], dtype=np.int64)
    content = cv2.imencode(".png", image)[1].tobytes()
    lens = STATIONS["ext_01"].camera
    footage = Footage("ext_01", lens, times, (CameraImage("ext_01", 0, content),), {})
    picture = scene.show_picture(body, 0, "ext_01", footage)
    assert picture is not None and picture.pixels.shape == (480, 640, 3)
    row, column = np.nonzero((picture.pixels == rgb(CONTOUR)).all(axis=2))
    assert len(row) > 100  # of points around a person some 250 px high
    assert 150 < np.ptp(row) < 479 and np.ptp(column) < np.ptp(row)
    assert server.scene.get_handle_by_name("/world/stations/ext_01").image is not None
    scene.show_picture(body, 0, "ext_00", None)
    assert server.scene.get_handle_by_name("/world/stations/ext_01").image is None


def test_the_contour_is_that_of_the_body_as_it_is_corrected(server: LocalServer, body: BodyModel) -> None:
    longer = Correction(body).moved_by(Part("joint", "knee_left"), Move(np.array([0.0, 0.0, -60.0]), np.zeros(3))).body
    seen = StationScene(server.scene, STATIONS)
    contours = [
        scene.contour("ext_01", shown, capsule_surfaces(shown), Motion.standing(shown).segments_at(shown, 0))
        for scene, shown in ((seen, body), (seen, longer), (StationScene(server.scene, STATIONS), longer))
    ]
    np.testing.assert_array_equal(contours[1], contours[2])
    assert not np.array_equal(contours[0], contours[1])


def test_hands_are_seen_but_not_written(stations: Path, body_file: Path) -> None:
    sources = Sources.read(None, None, body_file, None, stations)
    assert {"hand_left", "hand_right"} <= set(sources.body.segments)
    assert sources.reference_map is None and list(sources.stations) == list(STATIONS)
    moved = Correction(sources.body).moved_by(Part("joint", "knee_left"), Move(np.array([5.0, 0, 0]), np.zeros(3)))
    shown = sources.body_file.write(moved)
    assert shown.segments == sources.body.segments
    written = read_body(body_file)
    assert written.segments == tuple(s for s in sources.body.segments if not s.startswith("hand"))
    assert {joint.name for joint in with_hands(written).joints} == {joint.name for joint in shown.joints}


def test_a_body_file_is_written_as_it_was_without_stations(sample: Path, body_file: Path) -> None:
    file = BodyFile(body_file)
    body = file.read()
    assert file.write(Correction(body)).segments == body.segments == read_body(body_file).segments


def test_a_body_has_hands_if_it_was_solved_with_them(
    sample: Path, stations: Path, body_file: Path, tmp_path: Path
) -> None:
    """Whether or not stations are to be seen: who was solved from worn cameras alone has none."""
    bare = replace(read_body(body_file), mounts={})
    for name, body in (("without", bare), ("with", with_hands(bare))):
        poses = np.stack([Motion.standing(body).segments_at(body, 0)] * 3)
        out = write_solved(Walk(body, START_NS + FRAME_NS * np.arange(3, dtype=np.int64), poses), tmp_path / name)
        for given in (None, stations):
            assert Sources.read(out, sample / "map", body_file, None, given).body.segments == body.segments


def test_what_is_missing_is_named(stations: Path, body_file: Path, tiny_bag: Path) -> None:
    with pytest.raises(ViewError, match="with --map, or --stations"):
        Sources.read(None, None, body_file, None)
    with pytest.raises(ViewError, match=r"--stations .*cameras\.yaml --body"):
        Sources.read(None, None, body_file, tiny_bag, stations)
