"""Images of static cameras by time: bags have them in the order in which they came."""

from pathlib import Path

import numpy as np
import pytest
from tiny_bag import CAMERAS, FRAME_NS, HEIGHT, START_NS, WIDTH, write_camera_info, write_jpeg

from bodycam_ros.camera.perspective import PlumbBobCamera
from bodycam_ros.outside.station import Station
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.replay.measure_body import station_instants

LATE_NS = 3 * FRAME_NS
FRAMES = 6


def stations(height: int = HEIGHT) -> dict[str, Station]:
    lenses = {name: PlumbBobCamera(name, WIDTH, HEIGHT, 30.0, 30.0, 31.5, 23.5, (0.0,) * 5) for name in CAMERAS}
    lenses["right"] = PlumbBobCamera("right", WIDTH, height, 30.0, 30.0, 31.5, 23.5, (0.0,) * 5)
    return {name: Station(name, np.eye(4), lens) for name, lens in lenses.items()}


def write_late(path: Path, right_ahead_ns: int = 0) -> Path:
    """What the right camera saw came three frames late."""
    heard = [(START_NS + frame * FRAME_NS, "left", frame, 0) for frame in range(FRAMES)]
    heard += [(START_NS + frame * FRAME_NS + LATE_NS, "right", frame, right_ahead_ns) for frame in range(FRAMES)]
    with write_recording(path) as writer:
        for name in CAMERAS:
            write_camera_info(writer, name, START_NS)
        for recorded_ns, name, frame, ahead_ns in sorted(heard):
            write_jpeg(writer, name, recorded_ns, START_NS + frame * FRAME_NS + ahead_ns, 20 * (frame + 1))
    return path


def test_what_came_late_joins_its_own_time(tmp_path: Path) -> None:
    found = [*station_instants(write_late(tmp_path / "bag"), stations(), set())]
    assert [instant.stamp_ns for _, instant in found] == [START_NS + frame * FRAME_NS for frame in range(FRAMES)]
    for frame, (_, instant) in enumerate(found):
        assert {*instant.images} == {*CAMERAS}
        assert all(abs(int(image.mean()) - 20 * (frame + 1)) < 5 for image in instant.images.values())
    shares = [share for share, _ in found]
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] == 1.0


def test_cameras_that_run_freely_have_instants_of_their_own(tmp_path: Path) -> None:
    found = [*station_instants(write_late(tmp_path / "bag", FRAME_NS // 2), stations(), set())]
    assert [[*instant.images] for _, instant in found] == FRAMES * [["left"], ["right"]]
    stamps_ns = [instant.stamp_ns for _, instant in found]
    assert stamps_ns == sorted(stamps_ns)


def test_images_of_another_size_are_left_out_with_one_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    refused: set[str] = set()
    bag = write_late(tmp_path / "bag")
    for _ in range(2):
        found = [*station_instants(bag, stations(height=40), refused)]
        assert [[*instant.images] for _, instant in found] == FRAMES * [["left"]]
    assert refused == {"right"}
    assert sum("camera right" in record.message for record in caplog.records) == 1
