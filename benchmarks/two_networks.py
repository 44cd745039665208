"""The live graph over a bad wire: python -m benchmarks.two_networks BAG --map MAP --body BODY.yaml.

Two network namespaces of Linux stand for the worn computer (player, trackers) and the desk (registration, solver). The
wire between them is a program: it passes each frame on after a delay, loses some, and goes for some seconds while the
recording is played. What is left is counted at each stage. Needs root, /dev/net/tun and ROS 2.
"""

import argparse
import fcntl
import heapq
import json
import os
import random
import select
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from bodycam_ros.graph.declared_graph import READERS_OF_INFO, GraphArguments, GraphNode, graph
from bodycam_ros.recording.bag_reader import open_recording

_TUNSETIFF, _TAP, _NO_INFO = 0x400454CA, 0x0002, 0x1000
_WORN, _DESK = "bodycam_worn", "bodycam_desk"
_ADDRESSES = {_WORN: "10.77.0.1", _DESK: "10.77.0.2"}
_FRAME = 65536
_START_S, _QUIET_S = 90.0, 15.0
_REPOSITORY = Path(__file__).parents[1]


@dataclass
class Wire:
    """Passes frames between two network devices.

    Attributes:
        loss: share of the frames that are lost, each way.
        delay_s: of the others.
        is_cut: nothing passes.
        passed, lost, cut: frames that passed, were lost by chance, and came while nothing passed.
    """

    ends: tuple[int, int]
    loss: float
    delay_s: float
    is_cut: bool = False
    passed: int = 0
    lost: int = 0
    cut: int = 0
    _over: threading.Event = field(default_factory=threading.Event)

    def carry(self) -> None:
        """Work until ``end``."""
        waiting: list[tuple[float, int, int, bytes]] = []
        count = 0
        chance = random.Random(0)
        while not self._over.is_set():
            due_s = waiting[0][0] - time.monotonic() if waiting else 0.1
            ready, _, _ = select.select(self.ends, (), (), max(0.0, min(0.1, due_s)))
            for end in ready:
                frame = os.read(end, _FRAME)
                if self.is_cut:
                    self.cut += 1
                elif chance.random() < self.loss:
                    self.lost += 1
                else:
                    self.passed += 1
                    other = self.ends[self.ends[0] == end]
                    heapq.heappush(waiting, (time.monotonic() + self.delay_s, count := count + 1, other, frame))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, other, frame = heapq.heappop(waiting)
                with suppress(OSError):  # a device that is not up yet
                    os.write(other, frame)

    def end(self) -> None:
        """Stop."""
        self._over.set()


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)


@contextmanager
def wire(loss: float, delay_s: float) -> Iterator[Wire]:
    """Two namespaces with a wire between them."""
    with ExitStack() as stack:
        ends = []
        for name in (_WORN, _DESK):
            _run("ip", "netns", "add", name)
            stack.callback(_run, "ip", "netns", "del", name)
            device = f"tap_{name[-4:]}"
            end = os.open("/dev/net/tun", os.O_RDWR)
            stack.callback(os.close, end)
            fcntl.ioctl(end, _TUNSETIFF, struct.pack("16sH", device.encode(), _TAP | _NO_INFO))
            ends.append(end)
            inside = ("ip", "netns", "exec", name, "ip")
            _run("ip", "link", "set", device, "netns", name)
            _run(*inside, "address", "add", f"{_ADDRESSES[name]}/24", "dev", device)
            _run(*inside, "link", "set", "lo", "up")
            _run(*inside, "link", "set", device, "up")
            _run(*inside, "route", "add", "224.0.0.0/4", "dev", device)
        between = Wire((ends[0], ends[1]), loss, delay_s)
        thread = threading.Thread(target=between.carry, daemon=True)
        thread.start()
        try:
            yield between
        finally:
            between.end()
            thread.join()


def _start(where: str, *command: str, folder: Path, **more: int) -> "subprocess.Popen[str]":
    environment = os.environ | {
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(_REPOSITORY / "config/fastdds-network.xml"),
        "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    }
    with (folder / "log").open("a") as log:
        return subprocess.Popen(
            ["ip", "netns", "exec", where, sys.executable, "-m", *command],
            env=environment,
            stderr=log,
            text=True,
            cwd=_REPOSITORY,
            stdin=subprocess.PIPE,
            stdout=more.get("stdout", log.fileno()),
        )


def listen(cameras: Sequence[str]) -> None:
    """Count what arrives at the desk until the standard input ends, and print it; before, when the first tracks do."""
    import rclpy

    from bodycam_ros.nodes.parameters import message_class, reliable

    rclpy.init()
    node = rclpy.create_node("listener")
    stages = {"tracks": "bodycam_msgs/msg/FeatureTracks", "landmarks": "bodycam_msgs/msg/LandmarkMatches"}
    topics = {f"/{camera}/{stage}": kind for camera in cameras for stage, kind in stages.items()}
    topics["/joint_states"] = "sensor_msgs/msg/JointState"
    heard = dict[str, set[int]]()
    dropped = dict[str, int]()
    for topic, kind in topics.items():
        heard[topic] = set()
        node.create_subscription(message_class(kind), topic, partial(_note, heard[topic]), reliable(1000))
    report = message_class("diagnostic_msgs/msg/DiagnosticArray")
    node.create_subscription(report, "/diagnostics", partial(_note_dropped, dropped), reliable(1000))
    print("ready", flush=True)
    asked = threading.Event()
    threading.Thread(target=lambda: asked.set() if not sys.stdin.read() else None, daemon=True).start()
    is_playing = False
    while not asked.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
        if not is_playing and any(heard.values()):
            is_playing = True
            print("playing", flush=True)
    states = sorted(heard.pop("/joint_states"))
    gap_s = max((1e-9 * (after - before) for before, after in pairwise(states)), default=0.0)
    counts = {stage: sum(len(heard[f"/{camera}/{stage}"]) for camera in cameras) for stage in stages}
    counts["states"] = len(states)
    print(json.dumps({**counts, "longest_gap_s": round(gap_s, 3), "dropped": dropped}), flush=True)


def _note(stamps_ns: set[int], message: Any) -> None:
    stamps_ns.add(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def _note_dropped(counts: dict[str, int], message: Any) -> None:
    """Keep the latest of each node's counts of what was lost or dropped, where it is not 0."""
    for status in message.status:
        for value in status.values:
            if value.key.endswith((" lost", " dropped")) and value.value.isdecimal() and int(value.value):
                counts[f"{status.name}: {value.key}"] = int(value.value)


def play(arguments: argparse.Namespace, folder: Path, loss: float, delay_s: float, cut_s: float) -> dict[str, object]:
    """Play a bag over a wire; what arrived, and what did not.

    Raises:
        SystemExit: nothing arrived, or the recording was over before the wire came back.
    """
    given = GraphArguments(map=str(arguments.map), body=str(arguments.body), cameras=tuple(arguments.cameras))
    nodes = graph(given)
    source = GraphNode(
        "player", "player",
        {"bagfile": str(arguments.recording), "rate": arguments.rate, "readers": READERS_OF_INFO,
         "cameras": [*arguments.cameras]},
    )  # fmt: skip
    started: list[subprocess.Popen[str]] = []
    with wire(loss, delay_s) as between:
        try:
            listener = _start(
                _DESK, "benchmarks.two_networks", "--listen", *arguments.cameras, folder=folder, stdout=subprocess.PIPE
            )
            started.append(listener)
            assert listener.stdout is not None and listener.stdout.readline() == "ready\n"
            for node in (*nodes, source):
                where = _WORN if node.executable in ("tracker", "player") else _DESK
                started.append(
                    _start(where, "bodycam_ros.nodes.start", node.executable, *node.arguments(), folder=folder)
                )
            if cut_s:
                ready, _, _ = select.select([listener.stdout], (), (), _START_S)
                if not ready or listener.stdout.readline() != "playing\n":
                    raise SystemExit(f"no tracks arrived within {_START_S:g} s; see {folder / 'log'}")
                time.sleep(arguments.cut_after)
                between.is_cut = True
                time.sleep(cut_s)
                between.is_cut = False
                if started[-1].poll() is not None:
                    raise SystemExit(
                        f"{arguments.recording} was over before the wire came back, {arguments.cut_after + cut_s:g} s "
                        "after the first tracks: give a longer one, or a smaller --rate"
                    )
            started[-1].wait()
            time.sleep(_QUIET_S)
            told, _ = listener.communicate("", timeout=_START_S)
            frames = {"passed": between.passed, "lost": between.lost, "cut": between.cut}
            return dict(json.loads(told.splitlines()[-1])) | {"frames of the wire": frames}
        finally:
            for process in started:
                process.kill()
                process.wait()


def main() -> None:
    """Print what arrives over each wire."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path)
    parser.add_argument("--body", type=Path)
    parser.add_argument("--cameras", nargs="+", default=["waist_front", "thigh_left", "shin_left"])
    parser.add_argument("--rate", type=float, default=0.2)
    parser.add_argument("--cut-after", type=float, default=5.0, help="seconds after the first tracks")
    parser.add_argument("--log", type=Path, default=Path("."), help="folder for what the nodes print")
    arguments = parser.parse_args()
    with open_recording(arguments.recording) as recording:
        images = sum(recording.image_count(camera) for camera in arguments.cameras)
    print(f"{images} images of {len(arguments.cameras)} cameras", flush=True)
    for loss, delay_s, cut_s in ((0.0, 0.0, 0.0), (0.01, 0.0, 0.0), (0.05, 0.02, 0.0), (0.0, 0.02, 3.0)):
        arrived = play(arguments, arguments.log, loss, delay_s, cut_s)
        print(f"loses {loss:.0%}, takes {1e3 * delay_s:.0f} ms, gone for {cut_s:g} s: {arrived}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--listen"]:
        listen(sys.argv[2:])
    else:
        main()
