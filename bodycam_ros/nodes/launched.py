"""What the launch file starts on a host, of its arguments: namespace, frames, and which nodes of the graph. No ROS."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes.graph import (
    NodeProcess,
    cameras_of,
    follower,
    human,
    live_graph,
    outside_input,
    player,
    stations_of,
)
from bodycam_ros.outside.hands import with_hands

TRUTH = {"true": True, "True": True, "1": True, "false": False, "False": False, "0": False}

OF_NAMESPACE, NO_PREFIX = "of the namespace", "none"
"""What may be said of frames, but for a prefix."""

STATE_PUBLISHER = "robot_state_publisher"

FILES_OF_GRAPH = ("map", "body", "rig", "grown_map", "equipment", "stations", "surface", "start", "robot", "mapping")
"""Arguments that the executable ``graph`` takes by the same name."""

_SOLVER = "skeleton_solver"
_READ_IMAGES = ("tracker", "region_tracker", "graph")
_REGISTRATIONS = 4

_CLOCK_HZ = 40.0
"""Of the clock that is played, as ros2 bag has it."""

RESPAWN_DELAY_S = 2.0
"""A node that cannot run, because its map is missing, say, must not take the others' processors."""

_NODES_A_CORE = 4
"""Each takes some 2 s of a core to load for itself what it needs: with more of them that is felt."""

_MOST_HZ = 1000.0
"""The highest rate that robot_state_publisher takes: of every instant it is to say where the links are."""


@dataclass(frozen=True)
class Hosted:
    """What runs on a host.

    Attributes:
        nodes: of this package, in processes of their own.
        once: those that are not to be started again when they end: a bag is played once.
        state_publisher: parameters of robot_state_publisher; None where none is to run.
    """

    nodes: tuple[NodeProcess, ...]
    once: tuple[NodeProcess, ...]
    state_publisher: Mapping[str, object] | None


def hosted(given: Mapping[str, str], has_state_publisher: bool) -> Hosted:
    """What one host is to run.

    Args:
        given: all arguments of the launch file.
        has_state_publisher: whether robot_state_publisher is there, and may be used.

    Raises:
        BodyError, StationError: as of ``live_graph`` and ``follower``.
        SettingsError: arguments that do not go together, or a node that the graph does not have.
    """
    whole = _whole(given)
    namespace, prefix = given["namespace"], given["frame_prefix"]
    prefix = {OF_NAMESPACE: frames_of(namespace), NO_PREFIX: ""}.get(prefix, prefix)
    # What is not asked for is left to the parameter file.
    frames: dict[str, object] = {"frame_prefix": prefix} if prefix or given["frame_prefix"] == NO_PREFIX else {}
    follows_clock = TRUTH[given["use_sim_time"]]
    common = frames | ({"use_sim_time": True} if follows_clock else {})
    clock: dict[str, object] = {"clock": _CLOCK_HZ} if follows_clock else {}
    managed: dict[str, object] = {} if TRUTH[given["autostart"]] else {"autostart": False}
    nodes, publisher = of_host(whole, _names(given["nodes"])), None
    if has_state_publisher:
        nodes, publisher = beside_solver(nodes)
    if TRUTH[given["one_process"]] or _is_forked(given, nodes):
        one = NodeProcess("graph", "", {} if publisher is None else {"publish_links": False}, words=_words(given))
        nodes, playing = ([], [one]) if given["bagfile"] else ([one], [])
        playing = told(playing, namespace, common | managed | clock, given["transport"])
    else:
        playing = [_player(given, whole)] if given["bagfile"] else []
        playing = told(playing, namespace, frames | clock)
    nodes = told(nodes, namespace, common | managed, given["transport"])
    return Hosted(tuple(nodes), tuple(playing), None if publisher is None else {**publisher, **common})


def _whole(given: Mapping[str, str]) -> list[NodeProcess]:
    """The graph, of which other hosts may run some."""

    def path(name: str) -> Path | None:
        return Path(given[name]) if given[name] else None

    graph = live_graph(
        path("map"),
        Path(given["body"]),
        _names(given["cameras"]),
        _registrations(given),
        path("rig"),
        TRUTH[given["overwrite_body"]],
        path("grown_map"),
        given["equipment"],
        outside_input(path("stations"), path("surface"), path("start")),
    )
    return graph + follower(path("robot"), path("mapping")) + human(given["humans"])


def _player(given: Mapping[str, str], graph: Sequence[NodeProcess]) -> NodeProcess:
    # Not `ros2 bag play`, which starts before 18 nodes have loaded; it does as well in another terminal.
    rate, loop = _rate(given), TRUTH[given["loop"]]
    return player(Path(given["bagfile"]), rate, cameras_of(graph), loop, stations_of(graph))


def _registrations(given: Mapping[str, str]) -> int:
    """How many nodes share the registration: of one process one, unless more are asked for."""
    text = given["registrations"]
    if not text:
        return 1 if TRUTH[given["one_process"]] else _REGISTRATIONS
    if not text.isdecimal():
        raise SettingsError(f"registrations: expected how many, got {text!r}")
    return int(text)


def _rate(given: Mapping[str, str]) -> float:
    try:
        return float(given["rate"])
    except ValueError:
        raise SettingsError(f"rate: expected a number, got {given['rate']!r}") from None


def _names(text: str) -> list[str]:
    return [each.strip() for each in text.split(",") if each.strip()]


def frames_of(namespace: str) -> str:
    """Prefix of the frames of a person who is in a namespace: people in one graph share the map's frame alone."""
    return f"{namespace.strip('/')}/" if namespace.strip("/") else ""


def of_host(graph: Sequence[NodeProcess], names: Sequence[str]) -> list[NodeProcess]:
    """Those nodes of a graph that one host is to run.

    Args:
        graph: all of it.
        names: of executables, which stand for all nodes of their kind, or of nodes; all if empty.

    Raises:
        SettingsError: the graph has no such node.
    """
    known = dict.fromkeys([*(node.executable for node in graph), *(node.name for node in graph)])
    if unknown := [name for name in names if name not in known]:
        raise SettingsError(f"nodes: the graph has no {', '.join(unknown)}; it has {', '.join(known)}")
    return [node for node in graph if not names or node.executable in names or node.name in names]


def told(
    graph: Sequence[NodeProcess], namespace: str, common: Mapping[str, object], transport: str = ""
) -> list[NodeProcess]:
    """The nodes in a namespace, with parameters that they share.

    Args:
        graph: nodes.
        namespace: of all of them; empty: none of their own.
        common: parameters of every node.
        transport: how images are read; empty: as the parameter file says, or by default.
    """
    of_images: dict[str, object] = {"transport": transport} if transport else {}
    return [
        replace(
            node,
            namespace=namespace,
            parameters={
                **node.parameters,
                **common,
                **(of_images if node.executable in _READ_IMAGES else {}),
            },
        )
        for node in graph
    ]


def beside_solver(graph: Sequence[NodeProcess]) -> tuple[list[NodeProcess], dict[str, object] | None]:
    """A graph beside whose solver robot_state_publisher says where the links are, so that nothing is said twice.

    The solver says so itself where it makes the body, from a range of motion, or learns lengths of equipment: the
    robot_state_publisher of ROS 2 Jazzy knows but the description that it was started with.

    Args:
        graph: nodes of a host.

    Returns:
        The graph, and parameters of robot_state_publisher; None where none is to be started.

    Raises:
        BodyError: the body cannot be read.
    """
    solver = next((node for node in graph if node.executable == _SOLVER), None)
    if solver is None or solver.parameters.keys() & {"rig", "equipment"}:
        return [*graph], None
    person = read_body(Path(str(solver.parameters["body"])))
    body = with_hands(person) if "stations" in solver.parameters else person
    leaves_links = replace(solver, parameters={**solver.parameters, "publish_links": False})
    return [leaves_links if node is solver else node for node in graph], {
        "robot_description": urdf_text(body),
        "publish_frequency": _MOST_HZ,
        # A bag that is played again begins earlier than it has ended.
        "ignore_timestamp": True,
    }


def _is_forked(given: Mapping[str, str], nodes: Sequence[NodeProcess]) -> bool:
    """Whether the processes come of one that has loaded what they need: by itself where cores are few."""
    if given["processes"] == "auto":
        return len(nodes) > _NODES_A_CORE * (os.cpu_count() or 1)
    return given["processes"] == "forked"


def _words(given: Mapping[str, str]) -> tuple[str, ...]:
    """Command line of the executable ``graph``."""
    named = {f"--{name.replace('_', '-')}": given[name] for name in (*FILES_OF_GRAPH, "humans")}
    cameras = _names(given["cameras"])
    words = [word for flag, value in named.items() if value for word in (flag, value)]
    words += ["--cameras", *cameras] if cameras else []
    words += ["--registrations", str(_registrations(given))] if given["map"] else []
    words += ["--nodes", *_names(given["nodes"])] if _names(given["nodes"]) else []
    if not TRUTH[given["one_process"]]:
        words += ["--processes", *(["--respawn", f"{RESPAWN_DELAY_S:g}"] if TRUTH[given["respawn"]] else [])]
    words += ["--overwrite-body"] if TRUTH[given["overwrite_body"]] else []
    if given["bagfile"]:
        words += ["--bag", given["bagfile"], "--rate", f"{_rate(given):g}"]
        words += ["--loop"] if TRUTH[given["loop"]] else []
    return tuple(words)
