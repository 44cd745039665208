"""Nodes that are killed in the middle of the work of a real graph, started again, and timed until all is as before."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

from faults.recovery import Recovery
from faults.work import REPOSITORY
from live_graph import Graph, Started, running_graph

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.nodes.graph import NodeProcess, live_graph
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.typestore import recording_typestore

CAMERAS = ("waist_front", "torso_front", "thigh_left")
_RATE_HZ = 8.0
"""Of the images, every one of the sample's 30 a second: a slow walk, which a busy machine can follow, too."""
_START_S, _LONGEST_S, _CALM_S = 120.0, 40.0, 2.0
_STATES = "/joint_states"


def kill_nodes(folder: Path, times: int, on_kill: Callable[[str], None]) -> list[Recovery]:
    """Kill each node of a graph of three cameras so many times.

    Args:
        folder: for logs.
        times: of each node.
        on_kill: called with the node's name before each.
    """
    body = folder / "body.yaml"
    _write_body_of(CAMERAS, body)
    with running_graph(folder) as graph:
        session = _Session(graph)
        session.start(live_graph(REPOSITORY / "bags/map", body))
        try:
            session.until(session.has_states(5), _START_S)
        except TimeoutError:
            told = "; ".join(f"{name}: {_last_words(each)}" for name, each in session.running.items())
            return [Recovery("graph", fault=f"no joint states within {_START_S:.0f} s of its start; {told}")]
        recoveries = []
        for _ in range(times):
            for name in list(session.running):
                on_kill(name)
                recoveries.append(session.killed(name))
                recoveries += session.revived()
        return recoveries


def _write_body_of(cameras: tuple[str, ...], path: Path) -> None:
    """The sample's body, with these cameras and the segments that carry them."""
    body = read_body(REPOSITORY / "bags/body.yaml")
    mounts = {camera: body.mounts[camera] for camera in cameras}
    segments = tuple(name for name in body.segments if name in {mount.segment for mount in mounts.values()})
    joints = tuple(joint for joint in body.joints if {joint.parent, joint.child} <= set(segments))
    write_body(replace(body, segments=segments, joints=joints, mounts=mounts), path)


class _Session:
    """The cameras, played back and forth without end, and an ear for what the nodes say."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._outputs = {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in CAMERAS}
        graph.listen({**self._outputs, _STATES: "sensor_msgs/msg/JointState"})
        self._tracks = {f"/{camera}/tracks" for camera in CAMERAS}
        self._images = cycle(_back_and_forth())
        self._publishers: dict[str, Any] = {}
        self._due_s = time.monotonic()
        self._state_s, self._silent_s, self._count = time.monotonic(), 0.0, 0
        self.running: dict[str, Started] = {}

    def start(self, nodes: list[NodeProcess]) -> None:
        """Start nodes, for the first time or again."""
        self.running |= {started.node.name: started for started in self._graph.start(*nodes)}

    def revived(self) -> list[Recovery]:
        """Start those again that have ended by themselves; what they said."""
        ended = [each for each in self.running.values() if each.process.poll() is not None]
        self.start([each.node for each in ended])
        return [Recovery(each.node.name, fault=_last_words(each)) for each in ended]

    def has_states(self, more: int) -> Callable[[], bool]:
        """Whether so many joint states have come since."""
        count = len(self._graph.heard[_STATES])
        return lambda: len(self._graph.heard[_STATES]) >= count + more

    def until(self, condition: Callable[[], bool], longest_s: float) -> float:
        """Play and listen until something is the case; the seconds it took.

        Raises:
            TimeoutError: it never was.
        """
        begun_s = time.monotonic()
        while not condition():
            now = time.monotonic()
            if now - begun_s > longest_s or any(each.process.poll() is not None for each in self.running.values()):
                raise TimeoutError
            if now >= self._due_s:
                self._due_s = max(self._due_s + 1.0 / _RATE_HZ, now)
                self._publish(next(self._images))
            self._graph.hear(0.01)
            self._mind_the_gap()
        return time.monotonic() - begun_s

    def killed(self, name: str) -> Recovery:
        """Kill a node, start it again, and wait until what it makes is there."""
        started = self.running[name]
        before = self._endpoints(name)
        self._silent_s = 0.0
        started.process.kill()
        started.process.wait()
        if "Traceback" in started.printed:
            return Recovery(name, fault=_last_words(started))
        stamp = time.time_ns()
        self.start([started.node])
        try:
            back_s = self.until(lambda: bool(self._endpoints(name) - before), _LONGEST_S)
            recovered_s = self.until(self._is_as_before(name, stamp), _LONGEST_S)
            silent_s = self._silent_s
            self.until(self.has_states(int(_CALM_S * _RATE_HZ)), _LONGEST_S)
        except TimeoutError:
            return Recovery(name, fault=f"not as before within {_LONGEST_S:.0f} s: {_last_words(self.running[name])}")
        return Recovery(name, back_s, recovered_s, silent_s)

    def _is_as_before(self, name: str, since_ns: int) -> Callable[[], bool]:
        """Whether, of images taken since, all of a node's cameras are registered and joint states published."""
        topics = [topic for topic in self._outputs if name in (f"tracker_{topic.split('/')[1]}", "registration")]
        seen = {topic: len(self._graph.heard[topic]) for topic in (*topics, _STATES)}

        def is_so() -> bool:
            for topic in (*topics, _STATES):
                new = self._graph.messages(topic, seen[topic])
                if not any(stamp_ns(m.header.stamp) > since_ns and getattr(m, "registered", True) for m in new):
                    return False
            return True

        return is_so

    def _endpoints(self, name: str) -> set[bytes]:
        """Who publishes what a node makes."""
        if name == "skeleton_solver":
            return self._graph.publishers_of(_STATES)
        if name == "registration":
            return self._graph.publishers_of(f"/{CAMERAS[0]}/landmarks")
        return self._graph.publishers_of(f"/{name.removeprefix('tracker_')}/tracks")

    def _mind_the_gap(self) -> None:
        now, count = time.monotonic(), len(self._graph.heard[_STATES])
        self._silent_s = max(self._silent_s, now - self._state_s)
        if count > self._count:
            self._state_s, self._count = now, count

    def _publish(self, messages: list[tuple[str, str, Any]]) -> None:
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        for topic, kind, message in messages:
            stamp = replace(message.header.stamp, sec=seconds, nanosec=nanoseconds)
            message = replace(message, header=replace(message.header, stamp=stamp))
            if topic not in self._publishers:
                self._publishers[topic] = self._graph.publisher(topic, kind)
            self._publishers[topic].publish(bytes(recording_typestore().serialize_cdr(message, kind)))


def _last_words(started: Started) -> str:
    """The end of what a process printed, in a line; how it fares, if it said nothing."""
    code = started.process.poll()
    fares = "it runs" if code is None else f"exit code {code}"
    return " ".join(started.printed.split())[-200:] or f"{fares}, without a word"


def _back_and_forth() -> Iterator[list[tuple[str, str, Any]]]:
    """The instants of the sample, with each camera's intrinsics, to its end and back: a motion without a jump."""
    infos: dict[str, tuple[str, str, Any]] = {}
    instants: dict[int, list[tuple[str, str, Any]]] = {}
    with BagFile(REPOSITORY / "bags/sample/bag") as bag:
        wanted = [topic for topic in bag.topics if topic.split("/")[1] in CAMERAS]
        for topic, _, message in bag.messages(wanted):
            said = (topic, bag.topics[topic], message)
            if topic.endswith("/camera_info"):
                infos[topic] = said
            else:
                instants.setdefault(stamp_ns(message.header.stamp), []).append(said)
    there = [[*infos.values(), *instants[stamp]] for stamp in sorted(instants)]
    yield from there
    yield from there[-2:0:-1]
