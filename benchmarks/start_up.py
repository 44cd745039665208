"""Seconds until every node of the live graph is active, and to end: python -m benchmarks.start_up.

The ways: a process for each node, one process for all of them, and the launch file by ``ros2 launch`` where that is on
PATH. CPU and memory (proportional set sizes) are those of all processes when the last node has become active. No
bag is played: images on their way are 130 to 800 MB more, by how far the player is when the last node becomes active.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import rclpy
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState

from bodycam_ros.graph.declared_graph import GraphArguments, graph

WAYS = ("separate", "one", "launch")
ROOT = Path(__file__).parents[1]
_REGISTRATIONS = 4
_LONGEST_S = 90.0
_ASK_S = 0.5
_GRACE_S = 30.0


def commands(way: str, reference_map: Path, body: Path) -> tuple[list[list[str]], list[str]]:
    """Command lines of the processes, and the names of the managed nodes."""
    nodes = graph(GraphArguments(map=str(reference_map), body=str(body), registrations=_REGISTRATIONS))
    managed = [node.name for node in nodes]
    start = [sys.executable, "-m", "bodycam_ros.nodes.start"]
    if way == "separate":
        return [[*start, node.executable, *node.arguments()] for node in nodes], managed
    if way == "one":
        given = ("--map", str(reference_map), "--body", str(body), "--registrations", str(_REGISTRATIONS))
        return [[*start, "graph", *given]], managed
    launch_file = next((ROOT / "launch").glob("*.launch.py"))
    words = {"map": reference_map, "body": body, "registrations": _REGISTRATIONS}
    return [["ros2", "launch", str(launch_file), *(f"{name}:={value}" for name, value in words.items())]], managed


def start_up(way: str, reference_map: Path, body: Path) -> dict[str, float]:
    """Start the graph once and end it.

    Args:
        way: one of ``WAYS``.
        reference_map, body: inputs of the graph.

    Returns:
        active_s: until the last node was active; cpu_s, memory_mb: of all processes then; end_s: from SIGINT to the end
        of the last process; failed: processes with an exit code other than 0.

    Raises:
        TimeoutError: a node did not become active.
    """
    started, managed = commands(way, reference_map, body)
    with tempfile.TemporaryDirectory() as folder, _running(started, Path(folder)) as processes:
        begun_s = time.monotonic()
        _wait_until_active(managed)
        active_s = time.monotonic() - begun_s
        family = [pid for process in processes for pid in _family(process.pid)]
        cpu_s, memory = sum(map(_cpu_s, family)), sum(map(_memory, family))
        begun_s = time.monotonic()
        for process in processes:
            process.send_signal(signal.SIGINT)
        failed = sum(process.wait(_GRACE_S) != 0 for process in processes)
    end_s = time.monotonic() - begun_s
    return {"active_s": active_s, "cpu_s": cpu_s, "memory_mb": 1e-6 * memory, "end_s": end_s, "failed": failed}


@contextmanager
def _running(started: Sequence[Sequence[str]], folder: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    with (folder / "log").open("wb") as log:
        processes = [
            subprocess.Popen(words, stdout=log, stderr=subprocess.STDOUT, start_new_session=True) for words in started
        ]
        try:
            yield processes
        except BaseException:
            print((folder / "log").read_text(errors="replace")[-3000:], file=sys.stderr)
            raise
        finally:
            for process in processes:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()


def _wait_until_active(managed: Sequence[str]) -> None:
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node("start_up", context=context)
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        clients = {name: node.create_client(GetState, f"/{name}/get_state") for name in managed}
        deadline_s = time.monotonic() + _LONGEST_S
        while clients:
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"not active after {_LONGEST_S:g} s: {', '.join(clients)}")
            ready = {name: client for name, client in clients.items() if client.service_is_ready()}
            asked = {name: client.call_async(GetState.Request()) for name, client in ready.items()}
            until_s = time.monotonic() + _ASK_S
            while not all(answer.done() for answer in asked.values()) and time.monotonic() < until_s:
                executor.spin_once(timeout_sec=0.02)
            for name, answer in asked.items():
                if answer.done() and answer.result().current_state.id == State.PRIMARY_STATE_ACTIVE:
                    del clients[name]
            executor.spin_once(timeout_sec=0.05)
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def _family(pid: int) -> list[int]:
    """A process and its descendants."""
    found = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False).stdout
    return [pid, *(each for child in found.split() for each in _family(int(child)))]


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(pid: int) -> int:
    """Proportional set size [bytes]."""
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return 1024 * next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    bags = ROOT / "bags"
    parser.add_argument("--map", type=Path, default=bags / "map")
    parser.add_argument("--body", type=Path, default=bags / "body.yaml")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    given = parser.parse_args()
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(ROOT / "config/fastdds-shm.xml"))
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))  # not the graph of somebody else
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for way in given.ways:
        if way == "launch" and shutil.which("ros2") is None:
            print("launch: ros2 is not on PATH", file=sys.stderr)
            continue
        measured = start_up(way, given.map, given.body)
        print(json.dumps({"way": way, **{name: round(value, 1) for name, value in measured.items()}}), flush=True)


if __name__ == "__main__":
    main()
