"""Nodes leave ROS whatever happens: those that were refused, those that leave together, and those that get stuck."""

import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from bodycam_ros.nodes.graph import NodeProcess

pytestmark = pytest.mark.long

REPOSITORY = Path(__file__).parents[2]
_START_S, _SOON_S = 60.0, 20.0

NODE_OF_ITS_OWN = """
import ctypes, sys
from bodycam_ros.errors import BodyError
from bodycam_ros.nodes import farewell
from bodycam_ros.nodes.player_parameters import PlayerParameters
from bodycam_ros.nodes.run import run
from bodycam_ros.nodes.stage_node import StageNode

farewell.PATIENCE_S = {patience_s}

class Own(StageNode[PlayerParameters]):
    def __init__(self):
        super().__init__("own", PlayerParameters)
        {start}

    def work(self, stopped):
        print("worked")

    def destroy_node(self):
        {end}

sys.exit(run(Own, "own"))
"""


def _run_own(start: str, end: str, patience_s: float) -> "subprocess.CompletedProcess[str]":
    script = NODE_OF_ITS_OWN.format(start=start, end=end, patience_s=patience_s)
    command = [sys.executable, "-u", "-c", script]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=_START_S)


def test_a_node_that_gets_stuck_in_leaving_is_ended(graph: Any) -> None:
    # C code that keeps the interpreter's lock, as rclpy does.
    ended = _run_own(start="pass", end="ctypes.PyDLL(None).pause()", patience_s=0.5)
    assert ended.returncode == 1, ended
    assert ended.stdout == "worked\n"
    assert "Timeout" in ended.stderr and "in leave_ros" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_node_that_was_refused_leaves_ros_too(graph: Any) -> None:
    end = "print('left'); super().destroy_node()"
    ended = _run_own(start="raise BodyError('no such body')", end=end, patience_s=_START_S)
    assert (ended.returncode, ended.stdout, ended.stderr) == (1, "left\n", "own: error: no such body\n")


def test_a_node_that_leaves_hears_of_nobody_any_more(graph: Any) -> None:
    import rclpy

    from bodycam_ros.nodes.farewell import ignore_discovery

    contexts = [rclpy.Context(), rclpy.Context()]
    for context in contexts:
        rclpy.init(context=context)
    leaving, staying = (rclpy.create_node("passer_by", context=context) for context in contexts)
    graph.publisher("/early", "std_msgs/msg/String")
    for node in (leaving, staying):
        graph.until(lambda node=node: node.count_publishers("/early"), _SOON_S, "both hear of the publisher")
    assert ignore_discovery(leaving)
    graph.publisher("/late", "std_msgs/msg/String")
    graph.until(lambda: staying.count_publishers("/late"), _SOON_S, "one hears of the other publisher")
    assert not leaving.count_publishers("/late")
    for node, context in zip((leaving, staying), contexts, strict=True):
        node.destroy_node()
        rclpy.shutdown(context=context)


def _children_s() -> float:
    """Processor time of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_all_leave_when_all_are_told_at_once(graph: Any) -> None:
    began_s, ended_before_s = time.monotonic(), _children_s()
    trackers = graph.start(*(NodeProcess("tracker", f"tracker_{n}", {"camera": f"camera_{n}"}) for n in range(6)))
    infos = [
        graph.publisher(f"/{each.node.parameters['camera']}/camera_info", "sensor_msgs/msg/CameraInfo")
        for each in trackers
    ]
    graph.until(lambda: all(each.get_subscription_count() for each in infos), _START_S, "the trackers are up")
    start_s, start_cpu_s = time.monotonic() - began_s, sum(each.cpu_s() for each in trackers)
    told_s = time.monotonic()
    assert set(graph.end().values()) == {0}, graph.report()
    leave_s, leave_cpu_s = time.monotonic() - told_s, _children_s() - ended_before_s - start_cpu_s
    # Measured against the start, because the machine may be busy. Unloading all libraries would take a third of it.
    assert leave_cpu_s < 0.2 * start_cpu_s
    assert leave_s < start_s


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_closed_terminal_is_like_ctrl_c(graph: Any, number: signal.Signals) -> None:
    (tracker,) = graph.start(NodeProcess("tracker", "tracker", {"camera": "left"}))
    info = graph.publisher("/left/camera_info", "sensor_msgs/msg/CameraInfo")
    graph.until(info.get_subscription_count, _START_S, "the tracker is up")
    tracker.process.send_signal(number)
    assert tracker.process.wait(_SOON_S) == 0 and not tracker.printed
    graph.until(lambda: not info.get_subscription_count(), _SOON_S, "who stays hears at once that it has left")
