"""Every node is killed in the middle and started again: the graph goes on."""

import signal
from pathlib import Path
from typing import Any

import pytest
from helpers.live_graph import live_graph

from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.factory import stamp_ns

CAMERAS = ("waist_front", "thigh_left")
_START_S, _SOON_S = 90.0, 60.0


@pytest.mark.long
def test_every_node_is_killed_and_the_body_goes_on(graph: Any, sample: Path) -> None:
    from helpers.live_drivers import Drivers

    landmarks = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in CAMERAS}
    graph.listen(landmarks | {"/joint_states": "sensor_msgs/msg/JointState"})
    drivers = Drivers(graph, sample / "sample/bag", CAMERAS)
    nodes = live_graph(sample / "map", sample / "body.yaml", CAMERAS)
    running = {each.node.name: each for each in graph.start(*nodes)}
    graph.until(drivers.are_heard, _START_S, "the graph is up")
    drivers.until(lambda: len(graph.heard["/joint_states"]) > 20, _START_S, "the body is solved")

    def is_used(camera: str, since_ns: int) -> bool:
        heard = graph.messages(f"/{camera}/landmarks", start=-3)
        return any(message.registered and stamp_ns(message.header.stamp) > since_ns for message in heard)

    def is_solved(since_ns: int) -> bool:
        heard = graph.messages("/joint_states", start=-3)
        return any(stamp_ns(message.header.stamp) > since_ns for message in heard)

    for node in nodes:
        running[node.name].process.send_signal(signal.SIGKILL)
        running[node.name].process.wait()
        topic = _topic_of(node)
        published = graph.count_publishers(topic)
        (running[node.name],) = graph.start(node)
        # The killed one is remembered for some seconds, so one more is the new one.
        drivers.until(lambda t=topic, n=published: graph.count_publishers(t) > n, _SOON_S, f"{node.name} is back")
        since_ns = drivers.stamp_ns
        drivers.until(lambda since=since_ns: all(is_used(c, since) for c in CAMERAS), _SOON_S, "all are registered")
        drivers.until(lambda since=since_ns: is_solved(since), _SOON_S, "the body is solved")
    assert "Traceback" not in graph.report()


def _topic_of(node: GraphNode) -> str:
    """A topic that the node alone publishes."""
    if node.executable == "tracker":
        return f"/{node.parameters['camera']}/tracks"
    return f"/{CAMERAS[0]}/landmarks" if node.executable == "registration" else "/joint_states"
