from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from made_telemetry import add_telemetry, payload
from made_video import make_video

from bodycam_ros.ingest.camera_offsets import creation_clock, plausible_time, satellite_clock
from bodycam_ros.recording.camera_video import CameraVideo

NOON = datetime(2024, 5, 1, 12, 0, 0, tzinfo=UTC)


@pytest.fixture
def videos(tmp_path: Path) -> list[CameraVideo]:
    """Cameras that say of the time: satellites, satellites and a clock, a clock, one that was never set, nothing."""
    paths = {
        "head": add_telemetry(make_video(tmp_path / "plain_head.mp4"), tmp_path / "head.mp4", NOON),
        "hip": add_telemetry(
            make_video(tmp_path / "plain_hip.mp4"), tmp_path / "hip.mp4", NOON + timedelta(seconds=2.5), gps9=True
        ),
        "shin": make_video(tmp_path / "shin.mp4", created="2024-05-01T12:00:03Z"),
        "thigh": make_video(tmp_path / "thigh.mp4", created="1970-01-01T00:00:00Z"),
        "torso": make_video(tmp_path / "torso.mp4"),
    }
    return [CameraVideo.of_files(camera, [path]) for camera, path in paths.items()]


def test_satellites_tell_when_a_video_began(videos: list[CameraVideo]) -> None:
    times = satellite_clock(videos)({}).times
    assert (times["head"].start_s, times["head"].start_sigma_s, times["head"].source) == (0.0, 0.0, "telemetry")
    assert list(times) == ["head", "hip"]
    assert times["hip"].start_s == pytest.approx(2.5, abs=5e-3)
    assert 0.0 < times["hip"].start_sigma_s < 1.0


def test_a_clock_that_was_set_gives_the_time_of_creation(videos: list[CameraVideo]) -> None:
    assert list(creation_clock(videos)({}).times) == ["shin"]


@pytest.mark.parametrize("odd", [datetime(1970, 1, 1, tzinfo=UTC), datetime.now(UTC) + timedelta(days=400), None])
def test_clocks_that_were_never_set_say_nothing(odd: datetime | None) -> None:
    assert plausible_time(odd) is None
    assert plausible_time(NOON) == NOON


def test_telemetry_that_makes_no_sense_is_passed_over(tmp_path: Path) -> None:
    whole = payload(NOON, gps9=False)
    for number, content in enumerate(
        [
            whole[:30],
            whole[:8] + b"\xff" * 60,
            b"DEVC\x00\x01\xff\xff" * 20,
            payload(NOON, gps9=False, fix=0),
            bytes(64),
        ]
    ):
        path = tmp_path / f"odd_{number}.mp4"
        add_telemetry(make_video(tmp_path / "plain.mp4", frames=3), path, NOON, content=content)
        assert CameraVideo.of_files("odd", [path]).satellite_times() == []
