"""Which nodes make the live graph. Imports neither ROS nor NumPy: ``ros2 launch`` reads it in its own interpreter.

Each argument is declared once, in ``GraphArguments``, most of them as the parameter of a node; the launch file and the
executable ``graph`` take their arguments from there. One that a node has as a parameter goes to that node.
"""

import argparse
import ctypes
import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, Final

import msgspec

from bodycam_ros.body.urdf_xml import xml_elements
from bodycam_ros.errors import BodycamError, BodyError, SettingsError, StaticCameraError
from bodycam_ros.files.shown import other_than
from bodycam_ros.files.yaml_file import read_text, read_yaml
from bodycam_ros.formats.other_calibration import is_other_calibration
from bodycam_ros.graph.node_parameters import (
    OF_NODES,
    CommonParameters,
    ManagedParameters,
    PlayerParameters,
    RegistrationParameters,
    RetargetParameters,
    SolverParameters,
    TrackerParameters,
)
from bodycam_ros.settings import describe, setting, settings_from_mapping

USER_ERROR: Final = 2
"""Exit code of a node whose map, body, camera or bag is wrong: the launch file ends then, for starting the node again
would not mend that. A defect ends with 1, as Python does."""

READERS_OF_INFO: Final = 3
"""Nodes that read each camera's camera_info: its tracker, the registration, the solver."""

READERS_OF_LANDMARKS: Final = 2
"""Nodes that read each camera's landmarks: its tracker and the solver."""

_OPTICAL = "_optical_frame"
_CLOCK_HZ = 40.0
"""Rate of the clock that is played, as ros2 bag has it."""

_OF_STATIONS = ("surface", "start")
_OF_BODY_CAMERAS = ("cameras", "rig", "grown_map")


def _as(parameters_type: type, name: str) -> Any:
    """The parameter of a node, as an argument."""
    of = next(f for f in fields(parameters_type) if f.name == name)
    assert of.default is not MISSING
    return field(default=of.default, metadata=of.metadata)


@dataclass(frozen=True)
class GraphArguments:
    """Arguments of the launch file and of the executable ``graph``."""

    map: str = _as(RegistrationParameters, "map")
    body: str = _as(SolverParameters, "body")
    rig: str = _as(SolverParameters, "rig")
    overwrite_body: bool = _as(SolverParameters, "overwrite_body")
    equipment: str = _as(SolverParameters, "equipment")
    cameras: tuple[str, ...] = setting((), reason="the cameras to use; all of the body if empty")
    registrations: int = setting(
        4, limits=(1, 100), reason="nodes that share the registration of the cameras: one has time for 4 at 30 Hz"
    )
    grown_map: str = _as(RegistrationParameters, "grown_map")
    stations: str = _as(SolverParameters, "stations")
    surface: str = _as(SolverParameters, "surface")
    start: str = _as(SolverParameters, "start")
    urdf: str = _as(RetargetParameters, "urdf")
    mapping: str = _as(RetargetParameters, "mapping")
    bagfile: str = _as(PlayerParameters, "bagfile")
    imu: str = _as(PlayerParameters, "imu")
    prefix: str = _as(PlayerParameters, "prefix")
    topics: tuple[str, ...] = _as(PlayerParameters, "topics")
    rate: float = _as(PlayerParameters, "rate")
    loop: bool = _as(PlayerParameters, "loop")
    transport: str = _as(TrackerParameters, "transport")
    frame_prefix: str = _as(CommonParameters, "frame_prefix")
    use_sim_time: bool = setting(
        False, reason="whether the nodes' clocks follow /clock, which the player then publishes; stamps are the images'"
    )
    autostart: bool = _as(ManagedParameters, "autostart")
    nodes: tuple[str, ...] = setting(
        (),
        reason="what this computer runs: kinds such as tracker, or names such as tracker_head; all if empty",
    )

    @classmethod
    def from_texts(cls, texts: Mapping[str, str]) -> "GraphArguments":
        """Arguments as words of a command line; lists have commas.

        Raises:
            SettingsError: a word is not what the argument needs.
        """
        kinds = {each.name: each.type for each in describe(cls)}
        values = {name: _value(text, kinds[name]) for name, text in texts.items() if name in kinds}
        return settings_from_mapping(cls, values, "arguments")


@dataclass(frozen=True)
class GraphNode:
    """A node of the graph.

    Attributes:
        executable: as in ``ros2 run bodycam_ros EXECUTABLE``.
        name: of the node.
        parameters: its own, where they differ from their defaults.
        namespace: where it is not that of its process.
    """

    executable: str
    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    namespace: str = ""

    def arguments(self) -> list[str]:
        """Command line after the executable, for those who start it without a launch file."""
        given = [f"{name}:={json.dumps(value)}" for name, value in self.parameters.items()]
        words = ["--ros-args", "-r", f"__node:={self.name}"]
        words += ["-r", f"__ns:=/{self.namespace.strip('/')}"] if self.namespace.strip("/") else []
        return [*words, *(part for parameter in given for part in ("-p", parameter))]


def graph(of: GraphArguments) -> list[GraphNode]:
    """A tracker for each body camera, the registrations and the solver, which has the images of static cameras.

    A robot follows where one is given, and a bag is played once the whole graph reads it.

    Raises:
        BodyError, StaticCameraError, SettingsError: a file with names of cameras cannot be read, an argument is
            missing, or two of them exclude each other.
    """
    if not of.body:
        raise SettingsError("the argument 'body' is missing; give body:=body.yaml")
    stations = _static_cameras_in(of.stations) if of.stations else []
    if not stations and (needless := _given(of, _OF_STATIONS)):
        raise StaticCameraError(f"{', '.join(needless)}: for static cameras; add stations:=cameras.yaml")
    body_cameras = _body_cameras(of, bool(stations))
    # With a rig the body file is yet to be made.
    sensors = {"body": ""} if of.rig else {}
    nodes = [_node("tracker", f"tracker_{camera}", of, camera=camera, **sensors) for camera in body_cameras]
    count = min(of.registrations, len(body_cameras))
    for number in range(count):
        nodes.append(
            _node(
                "registration",
                "registration" if count == 1 else f"registration_{number + 1}",
                of,
                cameras=body_cameras[number::count],
                publish_map=number == 0,
                landmark_readers=READERS_OF_LANDMARKS,
            )
        )
    of_solver: dict[str, Any] = {"cameras": body_cameras} if of.cameras else {}
    nodes.append(
        _node(
            "skeleton_solver", "skeleton_solver", of, **of_solver, **({} if body_cameras else {"body_cameras": False})
        )
    )
    if of.urdf or of.mapping:
        if not (of.urdf and of.mapping):
            raise BodyError("a robot that follows needs both: urdf:=ROBOT.urdf mapping:=MAPPING.yaml")
        nodes.append(_node("retarget", "retarget", of))
    if unknown := [name for name in of.nodes if name not in _names(nodes)]:
        raise SettingsError(f"nodes: the graph has no {unknown[0]}; {other_than(unknown[0], _names(nodes))}")
    nodes = [node for node in nodes if not of.nodes or {node.executable, node.name} & {*of.nodes}]
    if of.bagfile:
        read: dict[str, Any] = {"cameras": [*body_cameras, *stations], "readers": READERS_OF_INFO}
        read |= {"image_only": stations} if stations else {}
        read |= {"clock": _CLOCK_HZ} if of.use_sim_time else {}
        nodes.append(_node("player", "player", of, **read))
    return nodes


def from_command_line(words: Sequence[str]) -> list[GraphNode]:
    """The nodes that the executable ``graph`` runs; a wrong argument ends the process with one line."""
    parser = argparse.ArgumentParser(
        "graph",
        description="The live graph in one process.",
        epilog="Settings: --ros-args --params-file FILE. A namespace: --ros-args -r __ns:=/anna",
    )
    for each in describe(GraphArguments):
        flag = f"--{each.name.replace('_', '-')}"
        default = f" (default: {each.default})" if each.default else ""
        switch: dict[str, Any] = {"nargs": "?", "const": "true", "metavar": "true|false"} if each.type is bool else {}
        parser.add_argument(flag, default="", help=f"{each.text()}{default}".replace("%", "%%"), **switch)
    own = words[: words.index("--ros-args")] if "--ros-args" in words else words
    given = {name: text for name, text in vars(parser.parse_args(own)).items() if text}
    try:
        return graph(GraphArguments.from_texts(given))
    except BodycamError as error:
        print(f"{parser.prog}: error: {error}", file=sys.stderr)
        sys.exit(USER_ERROR)


def _node(executable: str, name: str, of: GraphArguments, **own: Any) -> GraphNode:
    """A node with the arguments that it has as parameters, where they differ from the default."""
    known = {each.name for each in describe(OF_NODES[executable])} - {"cameras"}
    given = {
        each.name: getattr(of, each.name)
        for each in describe(GraphArguments)
        if each.name in known and getattr(of, each.name) != each.default
    }
    follows_clock = {"use_sim_time": True} if of.use_sim_time and executable != "player" else {}
    return GraphNode(executable, name, {**given, **own, **follows_clock})


def _body_cameras(of: GraphArguments, has_static_cameras: bool) -> list[str]:
    """The cameras on the body that are used."""
    if of.rig:
        there = _cameras_in(of.rig, "rig file")
        if of.cameras:
            raise BodyError(f"{of.rig}: a calibration needs all cameras of the rig, so leave out 'cameras'")
        return there
    there = _cameras_in(of.body, "body file")
    if of.equipment.endswith((".yaml", ".yml")):
        there += _cameras_in(of.equipment, "equipment file")
    if unknown := [camera for camera in of.cameras if camera not in there]:
        raise BodyError(f"{of.body}: the body has no camera {unknown[0]}; {other_than(unknown[0], there)}")
    if not of.map:
        if not has_static_cameras:
            raise StaticCameraError(
                "there is neither a map, which cameras on the body are registered in, nor a file of static cameras; "
                "give map:=MAP, stations:=cameras.yaml, or both"
            )
        if needless := _given(of, _OF_BODY_CAMERAS):
            raise StaticCameraError(f"{', '.join(needless)}: for cameras on the body, which need a map; give map:=MAP")
        return []
    if not there and not has_static_cameras:
        raise BodyError(f"{of.body}: the body has no camera")
    return [*dict.fromkeys(of.cameras)] or there


def _cameras_in(path: str, what: str) -> list[str]:
    """Names of the cameras in a body, rig or equipment file. Nodes read all of it; the launch file needs no more."""
    if path.lower().endswith(".urdf"):
        try:
            links = xml_elements(read_text(path, what, BodyError)).iterfind("link")
        except BodyError as error:
            raise BodyError(f"{path}: is no URDF: {error}") from error
        names = [link.get("name", "") for link in links]
        return [name.removesuffix(_OPTICAL) for name in names if name.endswith(_OPTICAL)]
    document = read_yaml(path, what, BodyError)
    cameras = document.get("cameras") if isinstance(document, Mapping) else None
    if cameras is not None and not isinstance(cameras, Mapping):
        raise BodyError(f"{path}: 'cameras' must be a table, a camera in each line")
    return [str(camera) for camera in cameras or ()]


def _static_cameras_in(path: str) -> list[str]:
    """Names of the cameras in a file of static cameras."""
    is_other = is_other_calibration(Path(path))
    document = None if is_other else read_yaml(path, "file of static cameras", StaticCameraError)
    if not isinstance(document, Mapping):
        raise StaticCameraError(
            f"{path}: is no table of static cameras; 'bodycam stations {path} -o cameras.yaml' makes one of the "
            "calibration of another program"
        )
    return [*document]


def _given(of: GraphArguments, names: Iterable[str]) -> list[str]:
    return [name for name in names if getattr(of, name)]


def _names(nodes: Sequence[GraphNode]) -> list[str]:
    return list(dict.fromkeys([*(node.executable for node in nodes), *(node.name for node in nodes)]))


def _value(text: str, kind: type) -> Any:
    """A word in the type of its argument; as it is if it is none, which is refused with the argument's name."""
    if kind is tuple:
        return tuple(each.strip() for each in text.split(",") if each.strip())
    with suppress(msgspec.ValidationError):
        return text if kind is str else msgspec.convert(text.lower(), kind, strict=False)
    return text


_CALLBACKS_S = 5
_RMW = "librmw_fastrtps_cpp.so"
_NODE_TO_RMW = "rcl_node_get_rmw_handle"
_RMW_TO_PARTICIPANT = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listener"
    "EPNS1_25DomainParticipantListenerENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""ReturnCode_t DomainParticipant::set_listener(DomainParticipantListener*, std::chrono::seconds timeout)"""


def without_discovery_callbacks(node_handle: int) -> bool:
    """Let a node's participant in DDS be called no more when others come and go; whether that was possible.

    Fast DDS destroys a participant only when none of its discovery callbacks runs, and waits for that with no time
    limit, which overflows where libstdc++ was built for a glibc before 2.30, as in the wheels: then it spins for ever
    and keeps the lock that the callback needs (eProsima/Fast-DDS issue 6513). It met 1 node in 500 of those that leave
    together. With a time limit the same call waits properly. Neither rclpy nor a profile offers it: hence ctypes.

    Args:
        node_handle: pointer to the node of rcl.
    """
    try:
        # The one that is in use; where another middleware is, there is nothing to do.
        rmw = ctypes.CDLL(_RMW, mode=os.RTLD_NOW | os.RTLD_NOLOAD)
        rcl = ctypes.CDLL("librcl.so", mode=os.RTLD_NOW | os.RTLD_NOLOAD)
        rmw_node_of = rcl[_NODE_TO_RMW]
        participant_of = rmw[_RMW_TO_PARTICIPANT]
        set_listener = rmw[_SET_LISTENER]
    except (OSError, AttributeError):
        return False
    rmw_node_of.restype = participant_of.restype = ctypes.c_void_p
    rmw_node_of.argtypes = participant_of.argtypes = [ctypes.c_void_p]
    set_listener.restype = ctypes.c_uint32
    set_listener.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    participant = participant_of(rmw_node_of(node_handle))
    return bool(participant) and set_listener(participant, None, _CALLBACKS_S) == 0
