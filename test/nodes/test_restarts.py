"""Every node is killed in the middle and started again: the graph goes on, though camera_info is said only once."""

import signal
import time
from pathlib import Path
from typing import Any

from bodycam_ros.messages.header import stamp_ns, time_message
from bodycam_ros.nodes.graph import READERS_OF_INFO, NodeProcess, live_graph
from bodycam_ros.recording.bag_file import BagFile

CAMERAS = ("waist_front", "thigh_left")
RATE = 6.0
"""Images a second: little, so that a machine that is busy with other tests holds it."""

FRAME_NS = 33_333_333
START_NS = 1_000_000_000_000
_START_S, _SOON_S = 90.0, 30.0
_RESUMED_S = 12.0
"""On an idle machine 2 s are enough; to load a node's libraries on a busy one takes several."""


class Drivers:
    """The sample's cameras, there and back again: a motion without end. They say their camera_info once."""

    def __init__(self, graph: Any, bag: Path) -> None:
        from bodycam_ros.nodes.message_classes import node_messages

        self._graph = graph
        self._make = node_messages()
        self._images: dict[str, list[bytes]] = {}
        self._infos: dict[str, Any] = {}
        topics = [f"/{camera}/{kind}" for camera in CAMERAS for kind in ("camera_info", "image_raw/compressed")]
        with BagFile(bag) as recorded:
            for topic, _, message in recorded.messages(topics):
                camera = topic.split("/")[1]
                if topic.endswith("camera_info"):
                    self._infos[camera] = message
                else:
                    self._images.setdefault(camera, []).append(bytes(message.data))
        self._publishers = {
            camera: graph.publisher(f"/{camera}/image_raw/compressed", "sensor_msgs/msg/CompressedImage")
            for camera in CAMERAS
        }
        self._info_publishers = {
            camera: graph.publisher(f"/{camera}/camera_info", "sensor_msgs/msg/CameraInfo") for camera in CAMERAS
        }
        self._started_s = 0.0
        self._next = 0

    @property
    def stamp_ns(self) -> int:
        """The stamp of the latest images."""
        return START_NS + (self._next - 1) * FRAME_NS

    def are_heard(self) -> bool:
        images, infos = self._publishers.values(), self._info_publishers.values()
        return all(publisher.get_subscription_count() for publisher in images) and all(
            publisher.get_subscription_count() == READERS_OF_INFO for publisher in infos
        )

    def start(self) -> None:
        for camera, info in self._infos.items():
            message = self._make("sensor_msgs/msg/CameraInfo", width=info.width, height=info.height)
            message.distortion_model, message.d = info.distortion_model, info.d.tolist()
            message.k = info.k.tolist()
            self._info_publishers[camera].publish(message)
        self._started_s = time.monotonic()

    def go_on(self) -> None:
        """Publish what is due by now."""
        while self._next < (time.monotonic() - self._started_s) * RATE:
            stamp = time_message(self._make, START_NS + self._next * FRAME_NS)
            for camera, images in self._images.items():
                turn = self._next % (2 * len(images) - 2)
                data = images[min(turn, 2 * len(images) - 2 - turn)]
                message = self._make("sensor_msgs/msg/CompressedImage", format="jpeg")
                message.header.stamp, message.data = stamp, data
                self._publishers[camera].publish(message)
            self._next += 1

    def until(self, condition: Any, timeout_s: float, what: str) -> None:
        """Go on until something is the case."""

        def holds() -> object:
            self.go_on()
            return condition()

        self._graph.until(holds, timeout_s, what)


def test_every_node_is_killed_and_the_body_goes_on(graph: Any, sample: Path) -> None:
    landmarks = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in CAMERAS}
    graph.listen(landmarks | {"/joint_states": "sensor_msgs/msg/JointState"})
    drivers = Drivers(graph, sample / "sample/bag")
    nodes = live_graph(sample / "map", sample / "body.yaml", CAMERAS)
    running = {each.node.name: each for each in graph.start(*nodes)}
    graph.until(drivers.are_heard, _START_S, "the graph is up")
    drivers.start()
    drivers.until(lambda: len(graph.heard["/joint_states"]) > 20, _START_S, "the body is solved")

    def is_used(camera: str, since_ns: int) -> bool:
        heard = graph.messages(f"/{camera}/landmarks", start=-3)
        return any(message.registered and stamp_ns(message.header.stamp) > since_ns for message in heard)

    def is_solved(since_ns: int) -> bool:
        heard = graph.messages("/joint_states", start=-3)
        return any(stamp_ns(message.header.stamp) > since_ns for message in heard)

    took: dict[str, tuple[float, float]] = {}
    for node in nodes:
        running[node.name].process.send_signal(signal.SIGKILL)
        running[node.name].process.wait()
        gone_s = time.monotonic()
        drivers.until(lambda gone_s=gone_s: time.monotonic() > gone_s + 1.0, _SOON_S, "a second passes")
        topic = _topic_of(node)
        published = graph.count_publishers(topic)
        (running[node.name],) = graph.start(node)
        started_s = time.monotonic()
        # The killed one is remembered for some seconds, so one more is the new one.
        drivers.until(lambda t=topic, n=published: graph.count_publishers(t) > n, _SOON_S, f"{node.name} is back")
        back_s, since_ns = time.monotonic(), drivers.stamp_ns
        drivers.until(lambda since=since_ns: all(is_used(c, since) for c in CAMERAS), _SOON_S, "all are registered")
        drivers.until(lambda since=since_ns: is_solved(since), _SOON_S, "the body is solved")
        took[node.name] = (back_s - started_s, time.monotonic() - back_s)
    print({name: f"up after {up:.1f} s, solved {solved:.2f} s later" for name, (up, solved) in took.items()})
    assert max(solved for _, solved in took.values()) < _RESUMED_S, took
    assert "Traceback" not in graph.report()


def _topic_of(node: NodeProcess) -> str:
    """A topic that the node alone publishes."""
    if node.executable == "tracker":
        return f"/{node.parameters['camera']}/tracks"
    return f"/{CAMERAS[0]}/landmarks" if node.executable == "registration" else "/joint_states"
