from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from helpers.made_video import make_video

from bodycam_ros.ingest.camera_offsets import creation_times, plausible_time
from bodycam_ros.recording.camera_video import CameraVideo

NOON = datetime(2024, 5, 1, 12, 0, 0, tzinfo=UTC)


@pytest.fixture
def videos(tmp_path: Path) -> list[CameraVideo]:
    """Cameras with a clock, one that was never set, none."""
    paths = {
        "shin": make_video(tmp_path / "shin.mp4", created="2024-05-01T12:00:03Z"),
        "thigh": make_video(tmp_path / "thigh.mp4", created="1970-01-01T00:00:00Z"),
        "torso": make_video(tmp_path / "torso.mp4"),
    }
    return [CameraVideo.of_files(camera, [path]) for camera, path in paths.items()]


def test_a_clock_that_was_set_gives_the_time_of_creation(videos: list[CameraVideo]) -> None:
    assert list(creation_times(videos, {})[0]) == ["shin"]


@pytest.mark.parametrize("odd", [datetime(1970, 1, 1, tzinfo=UTC), datetime.now(UTC) + timedelta(days=400), None])
def test_clocks_that_were_never_set_say_nothing(odd: datetime | None) -> None:
    assert plausible_time(odd) is None
    assert plausible_time(NOON) == NOON
