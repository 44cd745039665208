"""Over a network that loses frames, what is large comes too, and soon."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from two_computers import two_computers, why_not

REPOSITORY = Path(__file__).parents[2]
SCRIPT = REPOSITORY / "test/messages_over_wire.py"
COUNT = 100
LOSS, DELAY_S = 0.05, 0.02


def late_of_each(profile: Path, folder: Path) -> dict[str, list[float]]:
    """How late each message was that came [s], by its kind."""
    with two_computers(loss=LOSS, delay_s=DELAY_S) as (worn, desk):
        ways = {
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
            "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": f"{REPOSITORY}{os.pathsep}{REPOSITORY / 'test'}",
        }
        said, heard = folder / "said", folder / "heard"
        saying = worn.start([sys.executable, str(SCRIPT), "say", str(COUNT)], said, ways | peer(desk.address))
        hearing = desk.start([sys.executable, str(SCRIPT), "hear", str(COUNT)], heard, ways | peer(worn.address))
        try:
            assert hearing.wait(60.0) == 0, heard.read_text()
        finally:
            end(saying, hearing)
    late_s: dict[str, list[float]] = json.loads(heard.read_text().splitlines()[-1])
    return late_s


def peer(address: str) -> dict[str, str]:
    return {"ROS_STATIC_PEERS": address}


def end(*processes: "subprocess.Popen[bytes]") -> None:
    for process in processes:
        process.kill()
        process.wait()


def test_everything_comes_within_a_second(tmp_path: Path) -> None:
    for package in ("rclpy", "bodycam_msgs"):
        pytest.importorskip(package, reason=f"{package} is not installed; 'make test' installs it")
    if reason := why_not():
        pytest.skip(reason)
    late_s = late_of_each(REPOSITORY / "config/fastdds-network.xml", tmp_path)
    assert {kind: len(each) for kind, each in late_s.items()} == {"tracks": 90, "keyframe": 10}
    assert min(late_s["tracks"]) >= DELAY_S
    assert max(*late_s["tracks"], *late_s["keyframe"]) < 1.0
