"""A bag through the real live graph, and when each frame came and went. Needs ROS 2.

Every node is a process of its own, or all are in one.

The nodes are started, not imported: this file has no ROS.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import yaml

from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.kernels.preparation import prepare_kernels
from bodycam_ros.moments import Noted, read_moments
from bodycam_ros.nodes.graph import NodeProcess, live_graph, player
from bodycam_ros.share_folder import share_folder

_GRAPH = "graph"
_SHARED_MEMORY = "config/fastdds-shm.xml"
_READER_WAIT_S = 300.0
_LAST_FRAMES_S = 2.0
"""After the last image has been heard: what is on its way comes out."""

_GRACE_S = 60.0
_SLICE_S = 0.1
_DOMAINS = range(1, 102)
"""Those whose ports are outside of what Linux hands out to anybody who asks for a port."""


def play_live(
    bag: Path,
    reference_map: Path,
    body: Path,
    scratch: Path,
    cameras: Sequence[str],
    rate: float,
    output_delay: int,
    registrations: int,
    one_process: bool = False,
) -> dict[str, list[Noted]]:
    """Play a bag once through a graph that is started for it, on a DDS domain that does not leave the machine.

    Args:
        bag: to be played.
        reference_map: folder of the map.
        body: body YAML.
        scratch: empty folder for what the processes say and note.
        cameras: those to play and to use.
        rate: times the recorded speed.
        output_delay: frames that a state waits for later ones.
        registrations: nodes that share the registration.
        one_process: whether all nodes share a process.

    Returns:
        Name of a node -> what it noted.

    Raises:
        BodycamError: ROS 2 is not there, or a node ended by itself; the message has what it said.
    """
    for package in ("rclpy", "bodycam_msgs"):
        if find_spec(package) is None:
            raise BodycamError(f"this needs ROS 2, but {package} is not installed; 'make latency' installs it")
    prepare_kernels()
    nodes = live_graph(reference_map, body, cameras, registrations)
    playing = player(bag, rate, cameras)
    playing = replace(playing, parameters={**playing.parameters, "reader_wait": _READER_WAIT_S})
    nodes = [_as_measured(node, output_delay) for node in (*nodes, playing)]
    nodes = [_noting(node, scratch) for node in nodes]
    if one_process:
        _play_in_one(nodes, _arguments(reference_map, body, cameras, registrations, bag, rate), scratch)
    else:
        _play_in_many(nodes, bag, scratch)
    return {node.name: read_moments(_moments_file(node.name, scratch)) for node in nodes}


def _play_in_many(nodes: Sequence[NodeProcess], bag: Path, scratch: Path) -> None:
    playing = nodes[-1].name
    commands = {node.name: [node.executable, *node.arguments()] for node in nodes}
    with _running(commands, scratch) as processes:
        while processes[playing].poll() is None:
            _check_alive(processes, playing, scratch)
            time.sleep(_SLICE_S)
        if processes[playing].returncode:
            raise RecordingError(f"{bag}: cannot be played: {_said(playing, scratch)}")
        time.sleep(_LAST_FRAMES_S)
        _check_alive(processes, playing, scratch)


def _play_in_one(nodes: Sequence[NodeProcess], arguments: Sequence[str], scratch: Path) -> None:
    given = {f"/{node.name}": {"ros__parameters": dict(node.parameters)} for node in nodes}
    settings = scratch / "settings.yaml"
    settings.write_text(yaml.safe_dump(given))
    command = [_GRAPH, *arguments, "--ros-args", "--params-file", str(settings)]
    with _running({_GRAPH: command}, scratch) as processes:
        # The player writes what it noted when it has played all.
        while not _moments_file(nodes[-1].name, scratch).exists():
            _check_alive(processes, "", scratch)
            time.sleep(_SLICE_S)
        time.sleep(_LAST_FRAMES_S)
        _check_alive(processes, "", scratch)


def _arguments(
    reference_map: Path, body: Path, cameras: Sequence[str], registrations: int, bag: Path, rate: float
) -> list[str]:
    given = ["--map", str(reference_map), "--body", str(body), "--cameras", *cameras]
    return [*given, "--registrations", str(registrations), "--bag", str(bag), "--rate", str(rate)]


def _as_measured(node: NodeProcess, output_delay: int) -> NodeProcess:
    # What queues is to be seen, not mended by leaving images out.
    given: dict[str, dict[str, object]] = {
        "skeleton_solver": {"smoother.output_delay": output_delay},
        "tracker": {"longest_wait": 0.0},
    }
    return replace(node, parameters={**node.parameters, **given.get(node.executable, {})})


def _noting(node: NodeProcess, scratch: Path) -> NodeProcess:
    return replace(node, parameters={**node.parameters, "moments": str(_moments_file(node.name, scratch))})


def _moments_file(name: str, scratch: Path) -> Path:
    return scratch / f"{name}.csv"


def _check_alive(processes: dict[str, subprocess.Popen[bytes]], playing: str, scratch: Path) -> None:
    for name, process in processes.items():
        if name != playing and process.poll() is not None:
            raise BodycamError(f"the node {name} has ended by itself: {_said(name, scratch)}")


def _said(name: str, scratch: Path) -> str:
    return (scratch / f"{name}.log").read_text(errors="replace").strip()[-1000:] or "it said nothing"


@contextmanager
def _running(commands: Mapping[str, Sequence[str]], scratch: Path) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Processes by their names, which have ended when the block is left."""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(_DOMAINS[os.getpid() % len(_DOMAINS)]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }
    environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(share_folder() / _SHARED_MEMORY))
    processes: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, arguments in commands.items():
            command = [sys.executable, "-m", "bodycam_ros.nodes.start", *arguments]
            with (scratch / f"{name}.log").open("w") as log:
                processes[name] = subprocess.Popen(
                    command, stdout=log, stderr=subprocess.STDOUT, env=environment, start_new_session=True
                )
        yield processes
    finally:
        for process in processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline_s = time.monotonic() + _GRACE_S
        for process in processes.values():
            try:
                process.wait(max(0.0, deadline_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
