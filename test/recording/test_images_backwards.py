"""The images of a recording from its end to its start: the same, the other way round."""

from pathlib import Path

import numpy as np
import pytest
from made_video import make_video, number_in, write_lens
from tiny_bag import CAMERAS, FRAME_NS, START_NS, write_jpeg, write_tiny_bag

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.cli.main import main
from bodycam_ros.errors import RecordingError
from bodycam_ros.recording import bag_reader as module
from bodycam_ros.recording.bag_reader import Recording, images_backwards, open_recording
from bodycam_ros.recording.bag_writer import RecordingWriter

STRETCHES_S = (0.07, 0.4, 1.0)


def seen(images: object) -> list[tuple[str, int, float]]:
    return [(image.camera, image.stamp_ns, float(decode_grey(image).mean())) for image in images]  # type: ignore[attr-defined]


def both_ways(recording: Recording) -> tuple[list[tuple[str, int, float]], list[tuple[str, int, float]]]:
    """Forwards, and backwards turned round; the cameras of one instant in alphabetical order."""
    forwards = seen(recording.images(recording.cameras))
    backwards = seen(images_backwards(recording, recording.cameras))
    stamps = [stamp_ns for _, stamp_ns, _ in backwards]
    assert stamps == sorted(stamps, reverse=True)
    return sorted(forwards, key=lambda one: (one[1], one[0])), sorted(backwards, key=lambda one: (one[1], one[0]))


@pytest.mark.parametrize("stretch_s", STRETCHES_S)
def test_a_bag_of_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stretch_s: float) -> None:
    monkeypatch.setattr(module, "_STRETCH_NS", round(1e9 * stretch_s))
    with open_recording(write_tiny_bag(tmp_path / "bag", frames=24)) as recording:
        forwards, backwards = both_ways(recording)
        assert len(forwards) == 48 and forwards == backwards
        assert {one.camera for one in images_backwards(recording, CAMERAS[:1])} == set(CAMERAS[:1])


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two videos of 75 frames; one has a keyframe in 50, the other in 7."""
    videos, place = tmp_path_factory.mktemp("videos"), tmp_path_factory.mktemp("place") / "bag"
    for camera, every in (("left", 50), ("right", 7)):
        make_video(videos / f"{camera}.mp4", frames=75, keyframe_every=every, created="2024-05-01T12:00:00Z")
        write_lens(videos / f"{camera}.yaml")
    assert main(["ingest", str(videos), "-o", str(place)]) == 0
    return place


@pytest.mark.parametrize("stretch_s", STRETCHES_S)
def test_a_bag_of_video(video: Path, monkeypatch: pytest.MonkeyPatch, stretch_s: float) -> None:
    """Every frame is made of those before it, up to the keyframe."""
    monkeypatch.setattr(module, "_STRETCH_NS", round(1e9 * stretch_s))
    monkeypatch.setattr(module, "_FIRST_LOOK_BACK_NS", 100_000_000)
    with open_recording(video) as recording:
        forwards, backwards = both_ways(recording)
        numbers = [number_in(decode_grey(one)) for one in images_backwards(recording, ["left"])]
    assert forwards == backwards and len(forwards) == 150
    assert numbers == list(range(74, -1, -1))


def test_a_stamp_that_does_not_decrease_is_left_out_and_a_damaged_image_is_not(tmp_path: Path) -> None:
    def alter(writer: RecordingWriter) -> None:
        end_ns = START_NS + 4 * FRAME_NS
        write_jpeg(writer, "left", end_ns, START_NS, 200)
        write_jpeg(writer, "left", end_ns + FRAME_NS, end_ns, 210)

    with open_recording(write_tiny_bag(tmp_path / "bag", alter=alter)) as recording:
        backwards = [one for one in images_backwards(recording, ["left"])]
    stamps = [one.stamp_ns for one in backwards]
    assert stamps == [START_NS + k * FRAME_NS for k in (4, 3, 2, 1, 0)]
    assert all(np.diff(stamps) < 0)


def test_a_camera_that_is_not_there_is_named(tmp_path: Path) -> None:
    with (
        open_recording(write_tiny_bag(tmp_path / "bag")) as recording,
        pytest.raises(RecordingError, match="no camera 'nobody'"),
    ):
        list(images_backwards(recording, ["nobody"]))
