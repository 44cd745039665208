"""The launch file under the real ``ros2 launch``, in the workspace that ``make test-ros`` builds."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rclpy
from own_domain import own_domain
from rclpy.executors import SingleThreadedExecutor
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

BAGS = Path(__file__).parents[1] / "bags"
BAG = BAGS / "sample/bag"
SAMPLE = {"map": BAGS / "map", "body": BAGS / "body.yaml"}
FOUR = "waist_front,torso_front,thigh_left,shin_left"
INSTANTS = 60
AGREEMENT_DEG = 0.05
_UP_S, _PLAYED_S, _END_S = 120.0, 240.0, 90.0
_STARTED = re.compile(r"\[([\w.]+-\d+)\]: process started with pid \[(\d+)\]")


@pytest.fixture(scope="module")
def domain() -> Iterator[None]:
    """One ROS domain that no other test on this machine has."""
    with own_domain() as number, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(number))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield


class Launch:
    """A running ``ros2 launch`` and the joint states that were received, by stamp [ns]."""

    def __init__(self, process: "subprocess.Popen[bytes]", log: Path, executor: SingleThreadedExecutor) -> None:
        self.process, self.log, self._executor = process, log, executor
        self.received: list[JointState] = []

    @property
    def output(self) -> str:
        return self.log.read_text()

    def processes(self) -> list[tuple[str, int]]:
        """Name in the launch and process id of each start, in order."""
        return [(name, int(pid)) for name, pid in _STARTED.findall(self.output)]

    def until(self, holds: Callable[[], bool], seconds: float) -> None:
        deadline_s = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < deadline_s, self.output[-6000:]
            self._executor.spin_once(timeout_sec=0.1)

    def interrupt(self) -> int:
        """Ctrl-C in a terminal: SIGINT to the whole process group; the exit code."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(_END_S)


@contextmanager
def launched(folder: Path, **arguments: object) -> Iterator[Launch]:
    command = ["ros2", "launch", "bodycam_ros", "bodycam.launch.py", *(f"{k}:={v}" for k, v in arguments.items())]
    log, context = folder / "launch.log", rclpy.Context()
    rclpy.init(context=context)
    listener = rclpy.create_node("test_ros", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(listener)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # else a run in the background hands on "ignored"
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
    running = Launch(process, log, executor)
    listener.create_subscription(JointState, "/joint_states", running.received.append, 1000)
    try:
        yield running
    finally:
        for pid in (process.pid, *(pid for _, pid in running.processes())):
            try:
                os.killpg(process.pid, signal.SIGKILL) if pid == process.pid else os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        process.wait()
        executor.shutdown()
        listener.destroy_node()
        rclpy.shutdown(context=context)


def _angles(state: object) -> tuple[int, dict[str, float]]:
    stamp = state.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec, dict(zip(state.name, state.position, strict=True))


def test_arguments_are_shown() -> None:
    shown = subprocess.run(
        ["ros2", "launch", "bodycam_ros", "bodycam.launch.py", "--show-args"],
        capture_output=True, text=True, timeout=_UP_S, check=True,
    ).stdout  # fmt: skip
    assert {"map", "body", "bagfile", "cameras", "respawn"} <= set(re.findall(r"^\s+'(\w+)':", shown, re.MULTILINE))


def test_one_walk_through_agrees_with_replay(domain: None, tmp_path: Path) -> None:
    with launched(tmp_path, **SAMPLE, bagfile=BAG, rate=0.05) as walk:  # slow enough for two busy cores
        walk.until(lambda: len(walk.received) >= INSTANTS, _PLAYED_S)
        live = dict(map(_angles, walk.received))
    assert len(live) == INSTANTS
    given = [word for name, path in SAMPLE.items() for word in (f"--{name}", str(path))]
    out = tmp_path / "replayed"
    subprocess.run(["ros2", "run", "bodycam_ros", "bodycam", "replay", str(BAG), *given, "-o", str(out)], check=True)
    with AnyReader([out]) as reader:
        topics = [each for each in reader.connections if each.topic == "/joint_states"]
        replayed = dict(_angles(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(topics))
    assert replayed.keys() == live.keys()
    apart = [live[at][name] - angle for at, angles in replayed.items() for name, angle in angles.items()]
    assert np.degrees(np.median(np.abs(apart))) <= AGREEMENT_DEG


def test_a_killed_node_is_started_again_and_ctrl_c_ends_all(domain: None, tmp_path: Path) -> None:
    given = {"cameras": FOUR, "bagfile": BAG, "rate": 0.2, "loop": "true", "processes": "separate"}
    with launched(tmp_path, **SAMPLE, **given) as graph:
        graph.until(lambda: len(graph.received) > 5, _UP_S)
        name, pid = next(each for each in graph.processes() if each[0].startswith("tracker"))
        os.kill(pid, signal.SIGKILL)
        graph.until(lambda: sum(each == name for each, _ in graph.processes()) == 2, _UP_S)
        before = len(graph.received)
        graph.until(lambda: len(graph.received) > before + 20, _UP_S)
        assert graph.interrupt() in (0, 130)
        assert [each for each, pid in graph.processes() if Path(f"/proc/{pid}").exists()] == []


def test_a_wrong_map_is_named(domain: None, tmp_path: Path) -> None:
    nowhere = tmp_path / "no_map"
    with launched(tmp_path, map=nowhere, body=SAMPLE["body"], cameras=FOUR) as graph:
        graph.until(lambda: str(nowhere) in graph.output, _UP_S)
