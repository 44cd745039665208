"""A bag through the real live graph, and when each frame came and went. Needs ROS 2.

Every node is a process of its own, or all are in one.

The nodes are started, not imported: this file has no ROS.
"""

import json
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

from bodycam_ros.errors import BodycamError
from bodycam_ros.kernels import prepare_kernels
from bodycam_ros.live.graph import GraphArguments, GraphNode, graph
from bodycam_ros.moments import Noted, read_moments
from bodycam_ros.share_folder import share_folder

_GRAPH, _PLAYER = "graph", "player"
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
        BodycamError: ROS 2 is not installed, or a node ended by itself; the message has the end of its output.
    """
    for package in ("rclpy", "bodycam_msgs"):
        if find_spec(package) is None:
            raise BodycamError(f"this needs ROS 2, but {package} is not installed; 'make latency' installs it")
    prepare_kernels()
    arguments = GraphArguments(
        map=str(reference_map),
        body=str(body),
        cameras=tuple(cameras),
        registrations=registrations,
        bagfile=str(bag),
        rate=rate,
    )
    nodes = [_as_measured(node, output_delay, scratch) for node in graph(arguments)]
    commands = {node.name: [node.executable, *node.arguments()] for node in nodes}
    if one_process:
        settings = scratch / "settings.yaml"
        given = {f"/{node.name}": {"ros__parameters": dict(node.parameters)} for node in nodes}
        settings.write_text(yaml.safe_dump(json.loads(json.dumps(given))))  # lists instead of tuples
        words = [_GRAPH, f"--map={reference_map}", f"--body={body}", f"--cameras={','.join(cameras)}"]
        words += [f"--bagfile={bag}", f"--registrations={registrations}", f"--rate={rate}"]
        commands = {_GRAPH: [*words, "--ros-args", "--params-file", str(settings)]}
    _play(commands, scratch)
    return {node.name: read_moments(_moments_file(node.name, scratch)) for node in nodes}


def _play(commands: Mapping[str, Sequence[str]], scratch: Path) -> None:
    """Run the processes until the player, at its end, has written its moments, and what follows has come out."""
    with _running(commands, scratch) as processes:
        while not _moments_file(_PLAYER, scratch).exists():
            _check_alive(processes, scratch)
            time.sleep(_SLICE_S)
        time.sleep(_LAST_FRAMES_S)
        _check_alive(processes, scratch)


def _as_measured(node: GraphNode, output_delay: int, scratch: Path) -> GraphNode:
    # Images queue instead of being dropped, so that a queue shows.
    given: dict[str, dict[str, object]] = {
        "skeleton_solver": {"smoother.output_delay": output_delay},
        "tracker": {"longest_wait": 0.0},
        _PLAYER: {"reader_wait": _READER_WAIT_S},
    }
    moments = {"moments": str(_moments_file(node.name, scratch))}
    return replace(node, parameters={**node.parameters, **given.get(node.executable, {}), **moments})


def _moments_file(name: str, scratch: Path) -> Path:
    return scratch / f"{name}.csv"


def _check_alive(processes: Mapping[str, subprocess.Popen[bytes]], scratch: Path) -> None:
    for name, process in processes.items():
        code = process.poll()
        if code if name == _PLAYER else code is not None:
            said = (scratch / f"{name}.log").read_text(errors="replace").strip()[-1000:]
            raise BodycamError(f"the node {name} ended with exit code {code}: {said or 'no output'}")


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
