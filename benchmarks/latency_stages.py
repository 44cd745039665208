"""Where the time goes between an image and the joint state that it is part of, and what each process costs.

The clock of a state starts when the first image of it is published: the time of exposure is the camera's own affair.
What follows is that of the camera whose landmarks reach the solver last, the one that the state waited for.

Every node is a process of its own, or all are in one.

The nodes are started, not imported: this file has no ROS.
"""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.graph.declared_graph import GraphArguments, GraphNode, graph
from bodycam_ros.nodes.moments import COLUMNS, ClockTimes, Moment


class Noted(NamedTuple):
    """What happened to a frame in a process: its camera (empty where all are concerned), its stamp [ns], and when."""

    moment: Moment
    camera: str
    stamp_ns: int
    at: ClockTimes


STAGES = ("play", "track", "register", "way", "later", "solve")
"""Rows of ``Latency.stages_s``.

play: the other cameras' images, which the player publishes one after the other where cameras would all at once.
track: in the tracker, which decodes as well; its queue is not included.
register: in the registration.
way: between processes; the queues of those that are busy with another image or camera are in it.
later: landmarks are at the solver, but the state waits for later ones (``output_delay``, the assembler).
solve: in the solver, up to the joint state's publication.
"""

_SAME_INSTANT_NS = 8_000_000
"""Cameras' stamps apart, as the assembler takes them together."""

_WARM_UP = 2 / 3
"""Share of the states: the first images find their place in the whole map, the solver waits for its first second and
solves it at once, and what queued meanwhile has to go."""

_OF_CAMERA = (
    Moment.PLAYED,
    Moment.IMAGE_RECEIVED,
    Moment.TRACKING,
    Moment.TRACKED,
    Moment.TRACKS_RECEIVED,
    Moment.REGISTERED,
    Moment.LANDMARKS_RECEIVED,
)


@dataclass(frozen=True)
class Latency:
    """From image to joint state.

    Attributes:
        stamps_ns: (N,) states, ascending: the last third of a run.
        stages_s: (N, 6) what each of ``STAGES`` took; the sum of a row is the latency.
    """

    stamps_ns: NDArray[np.int64]
    stages_s: NDArray[np.float64]

    @property
    def total_s(self) -> NDArray[np.float64]:
        """(N,) latency of each state."""
        return np.asarray(self.stages_s.sum(axis=1))

    def total_in_real_time_s(self, rate: float) -> NDArray[np.float64]:
        """(N,) latency where later frames come as fast as they were recorded, and not at a rate below 1."""
        return np.asarray(self.total_s - (1.0 - rate) * self.stages_s[:, STAGES.index("later")])

    @property
    def way_s(self) -> float:
        """What a state spends on the way in the median: where that is longer than between two images, they queue."""
        of_instants = self.stages_s[:, STAGES.index("way")]
        return float(np.median(of_instants)) if len(of_instants) else float("inf")


def latency_of(noted: Iterable[Noted]) -> Latency:
    """The latency of every state of which all moments were noted.

    Args:
        noted: by all processes.
    """
    of_camera: defaultdict[str, dict[Moment, dict[int, int]]] = defaultdict(lambda: {m: {} for m in Moment})
    begun: dict[int, int] = {}
    solved: dict[int, int] = {}
    for note in noted:
        if note.moment is Moment.SOLVING:
            begun[note.stamp_ns] = note.at.steady_ns
        elif note.moment is Moment.SOLVED:
            solved[note.stamp_ns] = note.at.steady_ns
        else:
            of_camera[note.camera][note.moment][note.stamp_ns] = note.at.steady_ns
    chains = {camera: _chains(moments) for camera, moments in of_camera.items()}
    stamps, stages = [], []
    # A state at either end of the run can lack a moment: it began before the notes did, or never ended.
    for stamp_ns in sorted(begun.keys() & solved.keys()):
        found = (_nearest(*of_one, stamp_ns) for of_one in chains.values())
        near = [one for one in found if one is not None and one[-1] <= solved[stamp_ns]]
        if near:
            stamps.append(stamp_ns)
            stages.append(_stages(near, begun[stamp_ns], solved[stamp_ns]))
    cold = round(_WARM_UP * len(stamps))
    return Latency(np.array(stamps[cold:], np.int64), 1e-9 * np.array(stages, float).reshape(-1, len(STAGES))[cold:])


def _chains(moments: Mapping[Moment, Mapping[int, int]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(F,) stamps of a camera's frames that came all the way, and (F, 7) when they passed each moment [ns]."""
    stamps = sorted(set.intersection(*(set(moments[moment]) for moment in _OF_CAMERA)))
    rows = [[moments[moment][stamp] for moment in _OF_CAMERA] for stamp in stamps]
    return np.array(stamps, np.int64), np.array(rows, np.int64).reshape(-1, len(_OF_CAMERA))


def _nearest(stamps_ns: NDArray[np.int64], rows: NDArray[np.int64], stamp_ns: int) -> NDArray[np.int64] | None:
    if not len(stamps_ns):
        return None
    nearest = int(np.abs(stamps_ns - stamp_ns).argmin())
    return rows[nearest] if abs(int(stamps_ns[nearest]) - stamp_ns) <= _SAME_INSTANT_NS else None


def _stages(chains: Sequence[NDArray[np.int64]], start_ns: int, solved_ns: int) -> tuple[int, ...]:
    """What each stage took of one state [ns], by the chains of all cameras that it has."""
    first_ns = min(int(chain[0]) for chain in chains)
    awaited = max(chains, key=lambda one: int(one[-1]))
    played, heard, tracking, tracked, tracks_heard, registered, landmarks = awaited.tolist()
    on_the_way = (tracking - heard) + (heard - played) + (tracks_heard - tracked) + (landmarks - registered)
    # The solver may begin a state in the same call in which it hears of it, and notes the beginning after.
    waited = max(0, start_ns - landmarks)
    return (
        played - first_ns,
        tracked - tracking,
        registered - tracks_heard,
        on_the_way,
        waited,
        solved_ns - landmarks - waited,
    )


def cost_of_image(noted: Iterable[Sequence[Noted]]) -> float:
    """Processor time that the whole graph spends for an image, what it spends on messages included [s].

    The last third of the images counts, while they are played; NaN where too few are.

    Args:
        noted: by each process, in any order.
    """
    processes = [sorted(notes, key=lambda note: note.at.steady_ns) for notes in noted if notes]
    played = sorted(n.at.steady_ns for notes in processes for n in notes if n.moment is Moment.PLAYED)
    warm = played[round(_WARM_UP * len(played)) :]
    if len(warm) < 2:
        return float("nan")
    between = (warm[0], warm[-1])
    spent_ns = 0.0
    for notes in processes:
        at = [note.at.steady_ns for note in notes]
        spent_ns += float(np.diff(np.interp(between, at, [note.at.cpu_ns for note in notes]))[0])
    return 1e-9 * spent_ns / (len(warm) - 1)


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
        "skeleton_solver": {"estimator.output_delay": output_delay},
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
    environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(Path(__file__).resolve().parents[1] / _SHARED_MEMORY))
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


def read_moments(path: Path) -> list[Noted]:
    """Read what a process noted.

    Raises:
        RecordingError: it is not there, or no such file.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = csv.reader(file)
            if tuple(next(lines)) != COLUMNS:
                raise ValueError("its columns are others")
            return [Noted(Moment(what), camera, int(a), ClockTimes(int(b), int(c))) for what, camera, a, b, c in lines]
    except (OSError, ValueError, StopIteration) as error:
        raise RecordingError(f"{path}: no moments of a process ({error})") from error
