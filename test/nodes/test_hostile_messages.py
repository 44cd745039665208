"""Nodes under messages that nobody of ours sends, for as long as BODYCAM_HOSTILE_S says: they live, and go on after."""

import array
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.live_graph import live_graph

CAMERA = "waist_front"
JOINTS = "/joint_states"
_HOSTILE_S = float(os.environ.get("BODYCAM_HOSTILE_S", "20"))
_START_S, _SOON_S = 60.0, 90.0
_MOST_GROWTH_MB = 400.0
_HUGE = 2_000_000  # values of an array
_BURST = 50  # messages without a pause


def hostile_messages(random: np.random.Generator) -> Iterator[tuple[str, Any]]:
    """(topic, message) without end: stamps at random, arrays of any length, NaN, texts and bytes of no format."""
    from bodycam_ros.nodes.parameters import message_class

    def numbers(kind: str, count: int) -> Any:
        values = random.choice([np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0, 1.0], count)
        with np.errstate(over="ignore"):
            return array.array(kind, values.astype(np.float64 if kind == "d" else np.float32).tolist())

    def stamped(message: Any) -> Any:
        header = getattr(message, "header", None)
        if header is not None:
            header.stamp.sec = int(random.integers(-(2**31), 2**31))
            header.stamp.nanosec = int(random.integers(2**32))
            header.frame_id = "\x1b[31m" + "x" * int(random.integers(200))
        return message

    def image() -> Any:
        message = message_class("sensor_msgs/msg/CompressedImage")(format="jpeg; \x1b[2J")
        message.data = array.array("B", random.bytes(int(random.choice([0, 1, 100, _HUGE]))))
        return message

    def info() -> Any:
        message = message_class("sensor_msgs/msg/CameraInfo")(distortion_model="equidistant")
        message.width, message.height = (int(random.integers(2**32)) for _ in range(2))
        message.k, message.d = numbers("d", 9).tolist(), numbers("d", int(random.choice([0, 4, 100_000])))
        return message

    def joints() -> Any:
        count = int(random.choice([0, 1, 40, 100_000]))
        message = message_class("sensor_msgs/msg/JointState")(name=["knee_left_y"] * count)
        message.position = numbers("d", int(random.choice([0, count])))
        return message

    def imu() -> Any:
        message = message_class("sensor_msgs/msg/Imu")()
        message.angular_velocity.x, message.linear_acceleration.z = float("nan"), 1e300
        return message

    def tracks() -> Any:
        message = message_class("bodycam_msgs/msg/FeatureTracks")()
        return _filled(message, random, numbers)

    def landmarks() -> Any:
        return _filled(message_class("bodycam_msgs/msg/LandmarkMatches")(), random, numbers)

    def text() -> Any:
        return message_class("std_msgs/msg/String")(data="<robot>" * int(random.integers(1000)))

    makers = {
        f"/{CAMERA}/image_raw/compressed": image,
        f"/{CAMERA}/imu": imu,
        f"/{CAMERA}/tracks": tracks,
        f"/{CAMERA}/landmarks": landmarks,
        JOINTS: joints,
        "/robot_description": text,
        f"/{CAMERA}/camera_info": info,
    }
    while True:
        topic = list(makers)[int(random.integers(len(makers)))]
        yield topic, stamped(makers[topic]())


def _filled(message: Any, random: np.random.Generator, numbers: Any) -> Any:
    """A message whose sequences have lengths and values at random."""
    for field, kind in message.get_fields_and_field_types().items():
        count = int(random.choice([0, 1, 7, 1000, 100_000]))
        if kind in ("sequence<float>", "sequence<double>"):
            setattr(message, field, numbers("d" if "double" in kind else "f", count))
        elif kind == "sequence<uint32>":
            setattr(message, field, array.array("I", random.integers(0, 2**32, count, np.uint32).tolist()))
    return message


def memory_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.long
def test_nodes_live_through_hostile_messages_and_go_on(graph: Any, sample: Path) -> None:
    from helpers.live_drivers import Drivers

    graph.listen({JOINTS: "sensor_msgs/msg/JointState"})
    drivers = Drivers(graph, sample / "sample/bag", [CAMERA])
    nodes = graph.start(*live_graph(sample / "map", sample / "body.yaml", [CAMERA]))

    def goes_on(more: int = 5) -> None:
        before = len(graph.heard[JOINTS])
        drivers.until(lambda: len(graph.heard[JOINTS]) >= before + more, _SOON_S, "joint states go on")

    graph.until(drivers.are_heard, _START_S, "all listen")
    goes_on()
    before = {node.node.name: memory_mb(node.process.pid) for node in nodes}
    messages, publishers = hostile_messages(np.random.default_rng(5)), dict[str, Any]()
    end, sent = time.monotonic() + _HOSTILE_S, 0
    while time.monotonic() < end:
        for _ in range(_BURST):
            topic, message = next(messages)
            if topic not in publishers:
                kind = type(message)
                name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
                publishers[topic] = graph.publisher(topic, name)
            publishers[topic].publish(message)
            sent += 1
        drivers.go_on()
        time.sleep(0.02)
    assert sent > 100
    for node in nodes:
        assert not node.is_over, node.log[-3000:]
        assert "Traceback" not in node.log and "\x1b" not in node.printed, node.log[-3000:]
        growth = memory_mb(node.process.pid) - before[node.node.name]
        assert growth < _MOST_GROWTH_MB, f"{node.node.name} took {growth:.0f} MB more"
    for publisher in publishers.values():
        graph.listener.destroy_publisher(publisher)
    goes_on()
