"""A map that grows while cameras are registered in it: by keyframes that are asked for and wait for their turn."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from helpers.known_keyframes import body_camera, descriptors_of, place, small_map, tracks, unknown_points
from helpers.naming import names, naming

from bodycam_ros.errors import BodycamError
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.graph.live_mapper import LiveMapper
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame

CAMERA = body_camera()
UNKNOWN = unknown_points(100)


class Live:
    """A growth, its executor's tasks, what it asked for, and a camera that is registered in its map."""

    def __init__(self, **settings: object) -> None:
        self.tasks: list[Callable[[], object]] = []
        self.asked: list[str] = []
        given = replace(ExtensionSettings(capacity=200), **settings)
        self.mapper = LiveMapper(small_map(), given, self.asked.append, self.tasks.append)
        self.begin()

    def begin(self) -> None:
        self.registrar = CameraFront(CAMERA, self.mapper.map, PipelineSettings())
        self.mapper.start_camera(CAMERA.name, CAMERA)

    def see(self, frame: TrackFrame) -> LandmarkMatches:
        matches = self.registrar.register(frame)
        self.mapper.add_image(frame, matches)
        return matches

    def work(self) -> None:
        while self.tasks:
            self.tasks.pop(0)()


def all_tracks(number: int) -> TrackFrame:
    """The map's landmarks and the unknown points."""
    points = np.concatenate([small_map().points_world, UNKNOWN])
    return tracks(CAMERA, number, points, np.concatenate([small_map().descriptors, descriptors_of(len(UNKNOWN), 7)]))


def unknown_tracks(number: int, first: int) -> TrackFrame:
    return tracks(CAMERA, number, UNKNOWN, descriptors_of(len(UNKNOWN), 7), first, 10_000)


def test_a_camera_is_registered_by_what_has_grown_alone() -> None:
    live = Live()
    assert CameraFront(CAMERA, small_map(), PipelineSettings()).register(unknown_tracks(0, 0)).world_T_camera is None
    for number in range(5):
        assert live.see(all_tracks(number)).world_T_camera is not None
        live.work()
    assert live.mapper.landmarks > 90 and live.mapper.keyframes == 5
    live.begin()
    matches = live.see(unknown_tracks(6, first=6))
    assert matches.world_T_camera is not None and matches.grown == len(matches.landmark_ids) > 50
    assert np.linalg.norm(log_se3(inverse(place(6)) @ matches.world_T_camera)[3:]) < 5e-3


def test_a_map_whose_last_writing_failed_is_written_again(tmp_path: Path) -> None:
    """A managed node whose cleanup fails stays inactive: its user makes room, and cleans up again."""
    live, folder = Live(), tmp_path / "grown"
    small_map().save(tmp_path / "map")
    live.mapper.keep_in(folder, tmp_path / "map")
    for number in range(5):
        live.see(all_tracks(number))
        live.work()
    folder.mkdir()
    (folder / "thesis.txt").write_text("precious")
    with naming(BodycamError, "thesis.txt"):
        live.mapper.close()
    live.mapper.poll(0.0)  # its timer goes on
    (folder / "thesis.txt").unlink()
    live.mapper.close()
    assert ReferenceMap.load(folder).grown == live.mapper.landmarks


def test_a_map_that_may_not_grow_asks_for_nothing() -> None:
    live = Live(enabled=False)
    for number in range(5):
        live.see(all_tracks(number))
    assert not live.asked and not live.tasks and live.mapper.landmarks == 0


def grown(folder: Path, base: Path) -> LiveMapper:
    """A map that has grown and was written."""
    live = Live()
    small_map().save(base)
    live.mapper.keep_in(folder, base)
    for number in range(5):
        live.see(all_tracks(number))
        live.work()
    live.mapper.close()
    return live.mapper


def test_after_a_restart_it_goes_on_with_what_had_grown(tmp_path: Path) -> None:
    before = grown(tmp_path / "grown", tmp_path / "map")
    again = Live()
    again.mapper.keep_in(tmp_path / "grown", tmp_path / "map")
    assert again.mapper.landmarks == before.landmarks > 90
    again.begin()
    matches = again.see(unknown_tracks(6, first=6))
    assert matches.world_T_camera is not None
    assert np.linalg.norm(log_se3(inverse(place(6)) @ matches.world_T_camera)[3:]) < 5e-3


def test_landmarks_without_room_are_counted(tmp_path: Path) -> None:
    before = grown(tmp_path / "grown", tmp_path / "map")
    reasons: list[str] = []
    small = LiveMapper(small_map(), ExtensionSettings(capacity=50), print, print, reasons.append)
    small.keep_in(tmp_path / "grown", tmp_path / "map")
    assert small.landmarks == 50
    (reason,) = reasons
    assert names(reason, tmp_path / "grown") and names(reason, before.landmarks - 50)


def test_what_has_grown_from_another_map_is_refused_and_kept(tmp_path: Path) -> None:
    grown(tmp_path / "grown", tmp_path / "map")
    content = {path.name: path.read_bytes() for path in (tmp_path / "grown").iterdir()}
    other = LiveMapper(small_map(seed=2), ExtensionSettings(), print, print)
    with naming(BodycamError, tmp_path / "grown"):
        other.keep_in(tmp_path / "grown", tmp_path / "map")
    with naming(BodycamError, tmp_path / "map"):
        Live().mapper.keep_in(tmp_path / "map", tmp_path / "map")
    assert {path.name: path.read_bytes() for path in (tmp_path / "grown").iterdir()} == content


def test_a_map_is_written_when_it_is_due_and_only_if_it_changed(tmp_path: Path) -> None:
    live, folder = Live(), tmp_path / "grown"
    small_map().save(tmp_path / "map")
    live.mapper.keep_in(folder, tmp_path / "map")
    live.mapper.poll(0.0)
    assert live.mapper._writing is None, "nothing has grown yet"
    for number in range(5):
        live.see(all_tracks(number))
        live.work()
    live.mapper.poll(3600.0)
    assert live.mapper._writing is None, "it is not due"
    live.mapper.poll(0.0)
    writing = live.mapper._writing
    assert writing is not None
    writing.result(timeout=60.0)
    assert ReferenceMap.load(folder).grown == live.mapper.landmarks
    assert live.mapper.report().values["changes not saved"] == 0
    live.mapper.poll(0.0)
    assert live.mapper._writing is None, "it is as it was written"
