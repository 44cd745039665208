"""Videos that are written, read back."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.recording.video_file import DecodedFrame, frames, read_facts


def test_pictures_come_at_their_times(tmp_path: Path) -> None:
    times_s = [0.0, 0.04, 0.08, 0.16, 0.2]  # one is missing
    with video_writer(tmp_path / "v.mp4", 25.0) as write:
        for number, seconds in enumerate(times_s):
            write(seconds, np.full((65, 97, 3), 40 * number, np.uint8))
    facts = read_facts(tmp_path / "v.mp4")
    assert (facts.codec, facts.width, facts.height, facts.frames) == ("h264", 96, 64, 5)
    read = list(frames(tmp_path / "v.mp4"))
    assert [seconds for seconds, _ in read] == pytest.approx(times_s, abs=1e-4)
    brightness = [float(DecodedFrame(frame).colour().mean()) for _, frame in read]
    assert brightness == pytest.approx([0.0, 40.0, 80.0, 120.0, 160.0], abs=4.0)
