"""Which processes make the live graph: for the launch file, and for whoever starts them without one. Imports no ROS."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.equipment.coupled_body import coupled_body, held_equipment
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.errors import BodyError, StationError
from bodycam_ros.outside.outside_files import OutsideInput
from bodycam_ros.outside.stations_file import read_stations, refuse_worn
from bodycam_ros.robot.mapping import read_mapping

READERS_OF_INFO = 3
"""Nodes that read each camera's camera_info: its tracker, the registration, the solver."""

READERS_OF_LANDMARKS = 2
"""Nodes that read each camera's landmarks: its tracker and the solver."""


@dataclass(frozen=True)
class NodeProcess:
    """A node in a process of its own.

    Attributes:
        executable: as in ``ros2 run bodycam_ros <executable>``.
        name: of the node; empty where a process has several, which have names already.
        parameters: its own parameters.
        namespace: of the node and its topics, such as /anna; empty: none of its own.
        words: what comes on the command line before that.
    """

    executable: str
    name: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    namespace: str = ""
    words: tuple[str, ...] = ()

    @property
    def enclave(self) -> str:
        """Under which its process looks for its keys, where ROS 2's security is switched on."""
        return "/" + "/".join(filter(None, (self.namespace.strip("/"), self.name or self.executable)))

    def arguments(self, config: Path | None = None) -> list[str]:
        """Command line after the executable, for those who start it without a launch file."""
        given = [f"{name}:={json.dumps(value)}" for name, value in self.parameters.items()]
        arguments = [*self.words, "--ros-args", *(["-r", f"__node:={self.name}"] if self.name else [])]
        arguments += ["-r", f"__ns:=/{self.namespace.strip('/')}"] if self.namespace else []
        arguments += ["--params-file", str(config)] if config else []
        arguments += [part for parameter in given for part in ("-p", parameter)]
        return [*arguments, "--enclave", self.enclave]


def live_graph(
    reference_map: Path | None,
    body: Path,
    cameras: Sequence[str] = (),
    registrations: int = 1,
    rig: Path | None = None,
    overwrite_body: bool = False,
    grown_map: Path | None = None,
    equipment: str = "",
    outside: OutsideInput | None = None,
) -> list[NodeProcess]:
    """A tracker for each camera, the registration and the solver; a region tracker for each static camera.

    Args:
        reference_map: folder of the map; None where static cameras alone tell, in the frame of their file. They also do
            with a map where the body wears none.
        body: body YAML; with ``rig`` it is written, from a range of motion.
        cameras: those to use; all of the body if empty. A calibration needs all of the rig.
        registrations: processes that share the registration of the cameras among them.
        rig: rig YAML, where there is no body yet.
        overwrite_body: with ``rig``: whether a body that is there already may be replaced.
        grown_map: folder in which the registrations keep what their maps grow by; None: nowhere.
        equipment: name or file of what the person rides, holds or stands on; its cameras are tracked, too.
        outside: what is known of static cameras, if there are any.

    Raises:
        StationError: the file of static cameras cannot be read, the body wears one of them, there is neither a map nor
            any of them, or what worn cameras need is given without a map.
        BodyError: the body or the rig cannot be read, carries no camera, or lacks one of ``cameras``; or the equipment
            cannot be read, or does not fit the body.
    """
    if reference_map is None:
        given = {"cameras": cameras, "rig": rig, "grown_map": grown_map}
        if needless := [name for name, value in given.items() if value]:
            raise StationError(f"{', '.join(needless)}: for cameras on the body, which need a map; give map:=MAP")
        return _static_alone(body, equipment, outside, None)
    known, what = (body, "body") if rig is None else (rig, "rig")
    if rig is None:
        person = read_body(body)
        whole = coupled_body(person, held_equipment(equipment, person) if equipment else None)
        if outside is not None:
            refuse_worn(outside.stations, read_stations(outside.stations), whole)
            if not whole.mounts and not cameras:
                return _static_alone(body, equipment, outside, reference_map)
        carried = tuple(whole.mounts)
    else:
        if equipment:
            read_equipment(equipment)
        carried = tuple(Rig.from_yaml(rig).cameras)
    used = list(cameras_used(cameras, carried, f"{known}: the {what}"))
    if rig is not None and len(used) < len(carried):
        raise BodyError(f"{known}: a calibration needs all cameras of the rig, so leave out 'cameras'")
    count = min(max(1, registrations), len(used))
    names = ["registration"] if count == 1 else [f"registration_{number}" for number in range(1, count + 1)]
    of_solver: dict[str, object] = {"body": str(body)}
    if equipment:
        of_solver["equipment"] = equipment
    if len(used) < len(carried):
        of_solver["cameras"] = used
    if rig is not None:
        of_solver |= {"rig": str(rig), "map": str(reference_map), "overwrite_body": overwrite_body}
    watching = [] if outside is None else _region_trackers(body, equipment, outside, reference_map)
    if outside is not None:
        of_solver |= _of_stations(outside, reference_map)
    kept: dict[str, object] = {} if grown_map is None else {"grown_map": str(grown_map)}
    return [
        *(
            NodeProcess("tracker", f"tracker_{camera}", {"camera": camera, "map": str(reference_map)})
            for camera in used
        ),
        *(
            NodeProcess(
                "registration",
                name,
                {
                    "map": str(reference_map),
                    "cameras": used[start::count],
                    "publish_map": start == 0,
                    "landmark_readers": READERS_OF_LANDMARKS,
                    **kept,
                },
            )
            for start, name in enumerate(names)
        ),
        *watching,
        NodeProcess("skeleton_solver", "skeleton_solver", of_solver),
    ]


def outside_input(stations: Path | None, surface: Path | None, start: Path | None) -> OutsideInput | None:
    """What is known of static cameras; None where there are none.

    Raises:
        StationError: something is known, but not where they stand.
    """
    if stations is not None:
        return OutsideInput(stations, surface, start)
    if needless := [name for name, value in {"surface": surface, "start": start}.items() if value is not None]:
        raise StationError(
            f"{', '.join(needless)}: for static cameras; say where they stand with stations:=cameras.yaml"
        )
    return None


def _static_alone(
    body: Path, equipment: str, outside: OutsideInput | None, reference_map: Path | None
) -> list[NodeProcess]:
    """The graph without cameras on the body; the map, if any, says what the world is."""
    if outside is None:
        raise StationError(
            "there is neither a map, which cameras on the body are registered in, nor a file of static cameras; give "
            "map:=MAP, stations:=cameras.yaml, or both"
        )
    of_solver: dict[str, object] = {"body": str(body), "worn": False, **_of_stations(outside, reference_map)}
    if equipment:
        of_solver["equipment"] = equipment
    return [
        *_region_trackers(body, equipment, outside, reference_map),
        NodeProcess("skeleton_solver", "skeleton_solver", of_solver),
    ]


def _region_trackers(
    body: Path, equipment: str, outside: OutsideInput, reference_map: Path | None
) -> list[NodeProcess]:
    given: dict[str, object] = {"body": str(body), **_of_stations(outside, reference_map)}
    if equipment:
        given["equipment"] = equipment
    if outside.surface is not None:
        given["surface"] = str(outside.surface)
    return [
        NodeProcess("region_tracker", f"region_tracker_{station}", {"camera": station, **given})
        for station in read_stations(outside.stations)
    ]


def _of_stations(outside: OutsideInput, reference_map: Path | None) -> dict[str, object]:
    """What region trackers and solver are told alike."""
    paths = {"stations": outside.stations, "start": outside.start, "map": reference_map}
    return {name: str(path) for name, path in paths.items() if path is not None}


def cameras_used(asked: Sequence[str], carried: Sequence[str], by: str) -> tuple[str, ...]:
    """The cameras asked for, each once; all that are carried if none is.

    Raises:
        BodyError: one of them is not carried, or none is; ``by`` says by what.
    """
    if unknown := [camera for camera in asked if camera not in carried]:
        raise BodyError(f"{by} carries no camera {', '.join(unknown)}; it carries {', '.join(carried) or 'none'}")
    if not carried:
        raise BodyError(f"{by} carries no camera")
    return tuple(dict.fromkeys(asked)) or tuple(carried)


def cameras_of(graph: Iterable[NodeProcess]) -> list[str]:
    """The cameras on the body that a graph tracks."""
    return [str(node.parameters["camera"]) for node in graph if node.executable == "tracker"]


def stations_of(graph: Iterable[NodeProcess]) -> list[str]:
    """The static cameras that a graph looks through."""
    return [str(node.parameters["camera"]) for node in graph if node.executable == "region_tracker"]


def follower(urdf: Path | None, mapping: Path | None) -> list[NodeProcess]:
    """A robot that follows the body, if there is one.

    Args:
        urdf: of the robot.
        mapping: YAML of which of its links follow what.

    Raises:
        BodyError: one is given without the other, or the mapping cannot be read.
    """
    if urdf is None and mapping is None:
        return []
    if urdf is None or mapping is None:
        raise BodyError("a robot that follows needs both: robot:=ROBOT.urdf mapping:=MAPPING.yaml")
    read_mapping(mapping)
    return [NodeProcess("retarget", "retarget", {"urdf": str(urdf), "mapping": str(mapping)})]


def human(body_id: str) -> list[NodeProcess]:
    """The node that says the same as REP-155 does, if it is asked for.

    Args:
        body_id: REP-155's identifier of the body; empty: none.
    """
    return [NodeProcess("humans", "humans", {"body_id": body_id})] if body_id else []


def player(
    bag: Path, rate: float, cameras: Sequence[str] = (), loop: bool = False, stations: Sequence[str] = ()
) -> NodeProcess:
    """A player that starts once the whole graph listens.

    Args:
        bag: bag folder or .mcap file.
        rate: times the recorded speed.
        cameras: those to play; all of the bag if empty, although nobody may read them.
        loop: begin again at the end.
        stations: static cameras to play beside these, whose images alone are read.
    """
    given: dict[str, object] = {"bag": str(bag), "rate": rate, "readers": READERS_OF_INFO}
    if cameras or stations:
        given["cameras"] = [*cameras, *stations]
    if stations:
        given["image_only"] = list(stations)
    if loop:
        given["loop"] = True
    return NodeProcess("player", "player", given)
