"""More participants on one machine than Fast DDS looks for by itself: sixteen cameras, their drivers and tools."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.own_domain import own_domain

REPOSITORY = Path(__file__).parents[2]
_PROCESSES, _EACH = 4, 11
_PROGRAM = """
import os, sys, time
import rclpy
process, each, total = map(int, sys.argv[1:])
nodes = []
for number in range(each):
    context = rclpy.Context()
    rclpy.init(context=context)
    nodes.append(rclpy.create_node(f"one_{process}_{number}", context=context))  # a participant for each context
deadline_s, counts = time.monotonic() + 60.0, [0]
while min(counts) < total and time.monotonic() < deadline_s:
    time.sleep(0.5)
    counts = [sum(name.startswith("one_") for name in node.get_node_names()) for node in nodes]
print(*counts, flush=True)
sys.stdin.readline()  # the others may still look for these
for node in nodes:
    context = node.context
    node.destroy_node()
    context.shutdown()
"""


@pytest.mark.long
def test_forty_four_participants_find_each_other() -> None:
    pytest.importorskip("rclpy")
    with own_domain() as domain:
        ours = {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(REPOSITORY / "config/fastdds-shm.xml"),
        }
        total = _PROCESSES * _EACH
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(number), str(_EACH), str(total)],
                env={**os.environ, **ours},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            for number in range(_PROCESSES)
        ]
        try:
            counts = [process.stdout.readline().split() for process in processes if process.stdout is not None]
            for process in processes:
                process.communicate("\n", timeout=60.0)
        finally:
            for process in processes:
                process.kill()
    assert counts == [[str(total)] * _EACH] * _PROCESSES, "each sees all"
