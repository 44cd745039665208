"""The live graph on two computers: cameras and trackers on one, registrations and solver on the other. Needs ROS 2.

What was sent and heard is taken from the moments that the nodes note, whose clock all processes of a machine share.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from two_computers import Computer

from bodycam_ros.moments import Moment, Noted, read_moments
from bodycam_ros.nodes.graph import READERS_OF_INFO, READERS_OF_LANDMARKS, NodeProcess, live_graph, player

REPOSITORY = Path(__file__).parent.parent
PROFILE = REPOSITORY / "config/fastdds-network.xml"
_PORT = 11811
_READER_WAIT_S = 120.0
_QUIET_WITHIN_S = 120.0
_GRACE_S = 60.0
_HEARD = "diagnostics.json"
_LISTENER = Path(__file__).parent / "diagnostics_heard.py"
_WORN = ("tracker", "player")
"""What runs where the cameras are."""


@dataclass(frozen=True)
class Passed:
    """How the messages of one kind fared from one computer to the other.

    Attributes:
        sent, heard: how many.
        delays_s: (heard,) of the steady clock, from after publishing to within the reader's callback.
    """

    sent: int
    heard: int
    delays_s: NDArray[np.float64]

    @property
    def lost(self) -> int:
        return self.sent - self.heard


@dataclass(frozen=True)
class RunApart:
    """What came of a run.

    Attributes:
        tracks, landmarks: from trackers to registrations; from registrations to the solver.
        instants: that the solver published, by their stamps.
        played_s: how long the player played.
        sent_bytes: over the wire, from the cameras' computer and to it, while it played.
        exit_codes: of all nodes.
        diagnostics: name of a part -> its last report: level, text, hardware_id and values.
        said: what the processes printed.
    """

    tracks: Passed
    landmarks: Passed
    instants: int
    played_s: float
    sent_bytes: tuple[float, float]
    exit_codes: Mapping[str, int]
    diagnostics: Mapping[str, Mapping[str, str]]
    said: str


def environment(finding: str, profile: Path, there: Computer, server: Computer) -> dict[str, str]:
    """How the nodes of one computer find those of the other: by a ``server``, by ``peers``, or by ``multicast``."""
    common = {
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
        "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
        "PYTHONPATH": str(REPOSITORY),
    }
    ways = {
        "server": {"ROS_DISCOVERY_SERVER": f"{server.address}:{_PORT}"},
        "peers": {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": there.address},
        "multicast": {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
    }
    return common | ways[finding]


def run_apart(
    worn: Computer,
    desk: Computer,
    folder: Path,
    finding: str,
    bag: Path,
    reference_map: Path,
    body: Path,
    cameras: Sequence[str] = (),
    registrations: int = 1,
    rate: float = 1.0,
    quiet_s: float = 1.0,
    solves: bool = True,
    profile: Path = PROFILE,
) -> RunApart:
    """Play a bag on one computer and solve it on the other.

    Args:
        worn: where the cameras and their trackers are.
        desk: where registrations and solver run, and the discovery server.
        folder: for what the processes say and note.
        finding: ``server``, ``peers`` or ``multicast``.
        bag, reference_map, body, cameras, registrations, rate: as for ``live_graph`` and ``player``.
        quiet_s: how long nothing may have come for it to be over; longer than messages that were lost take.
        solves: whether there is a solver.
        profile: of Fast DDS.
    """
    nodes = [_told(node, folder, solves) for node in live_graph(reference_map, body, cameras, registrations)]
    nodes = nodes if solves else nodes[:-1]
    playing = _told(player(bag, rate, cameras), folder, solves)
    nodes.append(playing)
    ways = {worn: environment(finding, profile, desk, desk), desk: environment(finding, profile, worn, desk)}
    processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(name: str, where: Computer, *command: str, **more: str) -> subprocess.Popen[bytes]:
        command = (sys.executable, *command)
        processes[name] = where.start(command, folder / f"{name}.log", ways[where] | more)
        return processes[name]

    try:
        if finding == "server":
            start("discovery", desk, "-m", "bodycam_ros.cli.main", "discovery", desk.address, "--port", str(_PORT))
        start("listener", desk, str(_LISTENER), str(folder / _HEARD), ROS_SUPER_CLIENT="TRUE")
        for node in nodes:
            where = worn if node.executable in _WORN else desk
            start(node.name, where, "-m", "bodycam_ros.nodes.start", node.executable, *node.arguments())
        counted: list[tuple[float, int, int]] = []
        while processes["player"].poll() is None:
            for node in nodes:
                if node is not playing and processes[node.name].poll() is not None:
                    raise AssertionError(f"{node.name} has ended by itself\n{_said(folder)}")
            counted.append((time.monotonic(), worn.bytes_sent(), desk.bytes_sent()))
            time.sleep(0.1)
        assert processes["player"].returncode == 0, _said(folder)
        _wait_until_quiet(folder / _HEARD, quiet_s)
        counted.append((time.monotonic(), worn.bytes_sent(), desk.bytes_sent()))
        codes = {"player": 0} | {node.name: _end(processes[node.name]) for node in nodes if node is not playing}
        _end(processes["listener"])
    finally:
        for process in processes.values():
            if process.poll() is None:
                process.kill()
                process.wait()
    noted = {node.name: read_moments(folder / f"{node.name}.csv") for node in nodes}
    played_s = [1e-9 * each.at.steady_ns for each in noted["player"]]
    steady_s, *sent = np.array(counted).T
    sent_bytes = [float(np.diff(np.interp([played_s[0], played_s[-1]], steady_s, end))[0]) for end in sent]
    return RunApart(
        _passed(noted, Moment.TRACKED, Moment.TRACKS_HEARD),
        _passed(noted, Moment.REGISTERED, Moment.LANDMARKS_HEARD),
        len({each.stamp_ns for of_node in noted.values() for each in of_node if each.moment is Moment.SOLVED}),
        played_s[-1] - played_s[0],
        (sent_bytes[0], sent_bytes[1]),
        codes,
        json.loads((folder / _HEARD).read_text()),
        _said(folder),
    )


def _told(node: NodeProcess, folder: Path, solves: bool) -> NodeProcess:
    """A node that notes its moments, and knows whether there is a solver."""
    of_kind: dict[str, dict[str, object]] = {
        # What queues is to be seen, not mended by leaving images out.
        "tracker": {"longest_wait": 0.0},
        "registration": {"landmark_readers": READERS_OF_LANDMARKS - (not solves)},
        "skeleton_solver": {"smoother.output_delay": 0},
        "player": {"readers": READERS_OF_INFO - (not solves), "reader_wait": _READER_WAIT_S},
    }
    given = {"moments": str(folder / f"{node.name}.csv"), **of_kind[node.executable]}
    return replace(node, parameters={**node.parameters, **given})


def _wait_until_quiet(heard: Path, quiet_s: float) -> None:
    """Wait until nobody has had anything to do for so long."""
    begun_s = busy_s = time.monotonic()
    work = ("images waiting", "tracked per second", "frames per second", "registrations per second")
    while time.monotonic() < begun_s + _QUIET_WITHIN_S:
        reports = json.loads(heard.read_text()) if heard.is_file() else {}
        workers = [report for report in reports.values() if any(kind in report for kind in work)]
        for report in workers:
            if any(report.get(kind, "0") != "0" for kind in work):
                busy_s = max(busy_s, float(report["heard_s"]))
        if workers and all(float(report["heard_s"]) > busy_s + quiet_s for report in workers):
            return
        time.sleep(0.1)


def _end(process: "subprocess.Popen[bytes]") -> int:
    process.send_signal(signal.SIGINT)
    return process.wait(_GRACE_S)


def _said(folder: Path) -> str:
    return "\n".join(f"--- {log.stem}\n{log.read_text(errors='replace')}" for log in sorted(folder.glob("*.log")))


def _passed(noted: Mapping[str, Sequence[Noted]], sent: Moment, heard: Moment) -> Passed:
    def of(moment: Moment) -> dict[tuple[str, int], int]:
        return {
            (each.camera, each.stamp_ns): each.at.steady_ns
            for of_node in noted.values()
            for each in of_node
            if each.moment is moment
        }

    left, came = of(sent), of(heard)
    delays_s = [1e-9 * (came[key] - left[key]) for key in left.keys() & came.keys()]
    assert came.keys() <= left.keys()
    return Passed(len(left), len(came), np.array(delays_s))
