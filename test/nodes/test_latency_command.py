"""bodycam latency starts the real graph, and what it prints adds up."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from altered_sample import CAMERAS, write_altered_sample

pytestmark = pytest.mark.long

_PATIENCE_S = 240.0


@pytest.mark.parametrize("one_process", [False, True], ids=["processes", "one process"])
def test_the_live_graph_is_timed_from_image_to_joint_state(sample: Path, tmp_path: Path, one_process: bool) -> None:
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    bag = write_altered_sample(sample, tmp_path / "bag", frames=60)
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "latency", str(bag)]
    command += ["--map", str(sample / "map"), "--body", str(sample / "body.yaml")]
    command += ["--cameras", "3", "--delays", "2", "--rate", "0.5"]
    command += ["--one-process"] if one_process else []
    ended = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S, check=False)
    assert ended.returncode == 0, ended.stderr
    begins = [str(len(CAMERAS)), "0.5", "2"]
    (row,) = (words for words in map(str.split, ended.stdout.splitlines()) if words[:3] == begins)
    play, track, register, way, later, solve, median, p95, real_time = map(float, row[3:])
    assert min(play, way) >= 0.0 and min(track, register, solve) > 0.0
    two_frames_ms = 2 * 1000 / 30 / 0.5
    assert (0.0 if one_process else 0.7) * two_frames_ms < later < 1.4 * two_frames_ms
    assert later < median <= p95 and real_time < 0.8 * median
    (cost_ms,) = re.findall(r"processor time of an image, .* \[ms\]: ([\d.]+) \(3 cameras, delay 2\)", ended.stdout)
    assert float(cost_ms) > 0.0
