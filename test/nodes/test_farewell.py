"""Nodes leave ROS: stopped by a signal, refused, ended while they start; in processes of their own."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from bodycam_ros.graph.declared_graph import GraphNode

_START_S, _SOON_S = 90.0, 60.0


def test_nodes_that_are_stopped_by_a_signal_leave_with_code_0(graph: Any) -> None:
    numbers = (signal.SIGINT, signal.SIGTERM)
    started = graph.start(*(GraphNode("tracker", f"tracker_{n.name}", {"camera": n.name}) for n in numbers))
    infos = [graph.publisher(f"/{number.name}/camera_info", "sensor_msgs/msg/CameraInfo") for number in numbers]
    graph.until(lambda: all(each.get_subscription_count() for each in infos), _START_S, "the trackers are up")
    for each, number in zip(started, numbers, strict=True):
        each.process.send_signal(number)
    for each in started:
        assert each.process.wait(_SOON_S) == 0 and not each.printed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_interrupted_while_python_starts_leaves_with_code_0(number: int) -> None:
    """As the launch file starts it: with both signals blocked from before Python handles any."""
    command = ["env", "--block-signal=INT,TERM", sys.executable, "-m", "bodycam_ros.nodes.start", "tracker"]
    command += ["--ros-args", "-p", "camera:=left"]
    for late_s in (0.0, 0.02, 0.05, 0.2):
        node = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        while "python" not in Path(f"/proc/{node.pid}/exe").resolve().name:
            time.sleep(1e-4)
        time.sleep(late_s)
        node.send_signal(number)
        assert node.communicate(timeout=_START_S) == (b"", None)
        assert node.returncode == 0


@pytest.mark.long
@pytest.mark.parametrize("loading", ["numpy", "librmw_fastrtps_cpp"])
def test_a_node_is_stopped_while_it_starts(graph: Any, loading: str) -> None:
    """By Ctrl-C and by who starts it: libraries are loading, or it is entering ROS."""
    for number in (signal.SIGINT, signal.SIGTERM):
        (started,) = graph.start(GraphNode("tracker", f"hasty_{number.name}", {"camera": "left"}))
        maps = Path(f"/proc/{started.process.pid}/maps")
        graph.until(lambda maps=maps: loading in maps.read_text(), _START_S, f"{loading} is loaded")
        started.process.send_signal(number)
        assert started.process.wait(_START_S) == 0, started.printed
        assert not started.printed


def test_a_node_that_leaves_learns_of_no_publisher_any_more(graph: Any) -> None:
    """Fast DDS would wait for its discovery callbacks for ever."""
    import rclpy

    from bodycam_ros.nodes.process import ignore_discovery

    contexts = [rclpy.Context(), rclpy.Context()]
    for context in contexts:
        rclpy.init(context=context)
    leaving, staying = (rclpy.create_node("passer_by", context=context) for context in contexts)
    graph.publisher("/early", "std_msgs/msg/String")
    for node in (leaving, staying):
        graph.until(lambda node=node: node.count_publishers("/early"), _SOON_S, "both find the publisher")
    assert ignore_discovery(leaving)
    graph.publisher("/late", "std_msgs/msg/String")
    graph.until(lambda: staying.count_publishers("/late"), _SOON_S, "one finds the other publisher")
    assert not leaving.count_publishers("/late")
    for node, context in zip((leaving, staying), contexts, strict=True):
        node.destroy_node()
        rclpy.shutdown(context=context)
