"""The nodes' parameters: those of their own, and the settings of the stages.

One name and one check for YAML, command line and ``ros2 param``.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from bodycam_ros.all_settings import OF_COMMANDS
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes.common_parameters import ManagedParameters
from bodycam_ros.nodes.humans_parameters import DESCRIPTION, HumansParameters
from bodycam_ros.nodes.player_parameters import PlayerParameters
from bodycam_ros.nodes.region_parameters import RegionTrackerParameters
from bodycam_ros.nodes.retarget_parameters import RetargetParameters
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.robot.retargeting import RobotSettings
from bodycam_ros.settings import SettingDescription, describe, setting, settings_from_mapping

P = TypeVar("P")

SOURCE: Final = "parameters"

TRACKER_GROUPS: Final = ("tracker", "keypoints", "flow", "rotation", "direct", "pose_fit", "shutter")
REGISTRATION_GROUPS: Final = ("registrar", "growth", "matching", "absolute_pose", "pose_fit", "shutter", "doubt")
SOLVER_GROUPS: Final = (
    *(group for group in PipelineSettings.groups() if group not in (*TRACKER_GROUPS, *REGISTRATION_GROUPS, "extend")),
    "pose_fit",
    *CalibrationSettings.groups(),
)
"""The groups of settings that a node uses."""

_ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""First parts of the names of parameters that rclpy declares for every node."""


@dataclass(frozen=True)
class TrackerParameters(ManagedParameters):
    """Of the node ``tracker``."""

    camera: str = setting("", reason="the camera to track; its images are on <camera>/image_raw/compressed")
    map: str = setting(
        "",
        reason="folder of the reference map, made by 'bodycam map'; with its photographs landmarks are found directly, "
        "without it features are tracked until the registration names them",
    )
    transport: str = setting(
        "compressed",
        reason="'compressed' reads <camera>/image_raw/compressed, 'raw' <camera>/image_raw, 'video' and "
        "'foxglove' <camera>/image_raw/compressed_video or foxglove, which need foxglove_msgs; another one is taken if "
        "it alone is published",
    )
    image_queue: int = setting(
        60, unit="images", limits=(1, 10000), reason="how far the tracker may fall behind before images are lost: 2 s"
    )
    most_ahead: int = setting(
        5,
        unit="frames",
        limits=(1, 10000),
        reason="how far the tracker may run ahead of the registration: 0.2 s",
        live=True,
    )
    longest_wait: float = setting(
        1.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="when an image has waited for longer the machine does not keep up, and every second one is left out "
        "until it does again: before 'image_queue' is full; 0: never, where a slow machine is to catch up later",
        live=True,
    )
    recovery: float = setting(
        5.0,
        unit="s",
        limits=(0.0, 600.0),
        reason="how long no image may have waited for more than a quarter of that, before all are tracked again",
        live=True,
    )


@dataclass(frozen=True)
class RegistrationParameters(ManagedParameters):
    """Of the node ``registration``."""

    map: str = setting("", reason="folder of the reference map, made by 'bodycam map'")
    body: str = setting("", reason="body YAML, which names the cameras; not needed if 'cameras' is given")
    cameras: tuple[str, ...] = setting(
        (), reason="the cameras to register; those of 'body' if empty; several nodes may share them"
    )
    publish_map: bool = setting(True, reason="of several nodes over one map only one needs to publish map/points")
    landmark_readers: int = setting(
        1,
        limits=(0, 100),
        reason="a camera's first frames wait until so many nodes read its landmarks; the whole graph has two a camera, "
        "tracker and solver",
        live=True,
    )
    landmark_wait: float = setting(
        10.0, unit="s", limits=(0.0, 600.0), reason="go on without them when they are not there by then", live=True
    )
    grown_map: str = setting(
        "",
        reason="folder to be, in which each registration keeps its map with all that has grown, under its own name; "
        "started again it goes on from there; nothing is kept if empty",
    )
    save_interval: float = setting(
        60.0,
        unit="s",
        limits=(1.0, 86400.0),
        reason="how often 'grown_map' is written if it has changed; so much of the growth is lost by a crash, and the "
        "whole map, some 20 MB, is written each time",
        live=True,
    )


@dataclass(frozen=True)
class SolverParameters(ManagedParameters):
    """Of the node ``skeleton_solver``."""

    body: str = setting("", reason="body YAML: segments, joints, camera mounts; with 'rig' it is written")
    equipment: str = setting(
        "",
        reason="what the person rides, holds or stands on: a YAML file that says where, or the name of a supplied one "
        "such as 'bicycle'",
    )
    cameras: tuple[str, ...] = setting((), reason="the cameras to listen to; all of the body if empty")
    rig: str = setting(
        "", reason="rig YAML; if given, the node collects a range of motion, and the service ~/calibrate makes the body"
    )
    map: str = setting(
        "",
        reason="with 'rig': folder of the reference map, which must have a scale and a vertical for a body to be made; "
        "with 'stations': the map whose frame is the world",
    )
    stations: str = setting(
        "", reason="YAML of static cameras, whose <camera>/segment_poses are listened to; none if empty"
    )
    start: str = setting(
        "", reason="with 'stations': YAML of where the body is at first; if empty worn cameras must tell"
    )
    worn: bool = setting(True, reason="whether to listen to cameras on the body; false where static ones alone tell")
    publish_links: bool = setting(
        True,
        reason="whether /tf and /tf_static have every link of robot_description, cameras among them; false where "
        "robot_state_publisher says so: then /tf has the root alone",
    )
    mass: float = setting(
        0.0,
        unit="kg",
        limits=(0.0, 1000.0),
        reason="mass of the whole person; robot_description then has inertials, by the table of de Leva 1996; 0: none",
    )
    marker_rate: float = setting(
        1000.0,
        unit="Hz",
        limits=(0.0, 1000.0),
        reason="/skeleton is published at most so often, for people who look at it; 0: never",
        live=True,
    )
    overwrite_body: bool = setting(False, reason="with 'rig': whether a body that is there already may be replaced")
    facing: float = setting(
        float("nan"),
        unit="deg",
        reason="with 'rig': where the person faces in the N-pose, about the map's z from its x; by hips and shoulders "
        "if it is not given",
    )
    info_wait: float = setting(
        0.5,
        unit="s",
        limits=(0.0, 600.0),
        reason="once the first camera_info is here, how long to wait for the other cameras' before starting; they join "
        "when theirs comes",
        live=True,
    )
    idle_flush: float = setting(
        3.0,
        unit="s",
        limits=(0.1, 600.0),
        reason="when no camera was heard for so long, publish the instants that wait for later ones",
        live=True,
    )


ALL: Final = (
    TrackerParameters,
    RegionTrackerParameters,
    RegistrationParameters,
    SolverParameters,
    RetargetParameters,
    HumansParameters,
    PlayerParameters,
)
"""One parameter file serves all nodes, so each must know what is meant for another."""


def given_parameters(node: Node) -> dict[str, Any]:
    """What parameter files and the command line say, whoever it is meant for.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``; afterwards it has none of these
            parameters any more, so that they can be declared with their descriptions.
    """
    there: Mapping[str, Any] = node.get_parameters_by_prefix("")  # rclpy annotates them as values
    given = {
        name: parameter.value
        for name, parameter in there.items()
        if name.split(".")[0] not in _ROS_OWN and not name.startswith(DESCRIPTION)
    }
    for name in given:
        node.undeclare_parameter(name)
    return given


def settings_from_parameters(given: dict[str, Any]) -> tuple[PipelineSettings, CalibrationSettings]:
    """Settings of all stages, and of the calibration, from parameters named ``group.setting``.

    Raises:
        SettingsError: an unknown name, a wrong type, a value out of range, or one that only a recording can have.
    """
    grouped = _grouped(given)
    calibration = {group: grouped.pop(group) for group in CalibrationSettings.groups().keys() & grouped.keys()}
    # One file serves all commands; no stage makes a map, listens to sound, measures a lens, or lets a robot follow.
    for of_commands in OF_COMMANDS:
        own = of_commands.groups().keys() - PipelineSettings.groups().keys()
        of_commands.from_mapping({group: grouped.pop(group) for group in own & grouped.keys()}, SOURCE)
    pipeline = PipelineSettings.from_mapping(grouped, SOURCE)
    pipeline.smoother.check_live()
    return pipeline, CalibrationSettings.from_mapping(calibration, SOURCE)


def robot_settings(given: dict[str, Any]) -> RobotSettings:
    """Settings of a robot that follows.

    Raises:
        SettingsError: an unknown name, a wrong type, or a value out of range.
    """
    grouped = _grouped(given)
    return RobotSettings.from_mapping({group: grouped[group] for group in RobotSettings.groups()}, SOURCE)


def _grouped(given: dict[str, Any]) -> defaultdict[str, dict[str, Any]]:
    """Group -> its settings, of parameters named ``group.setting``."""
    grouped: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for name, value in given.items():
        group, dot, setting_name = name.partition(".")
        if dot:
            grouped[group][setting_name] = value
    return grouped


def own_parameters(given: dict[str, Any], parameters_type: type[P]) -> P:
    """The node's own parameters, which have no group.

    Raises:
        SettingsError: no node has such a parameter, a wrong type, or a value out of range.
    """
    known = {f.name for each in ALL for f in fields(each)}
    plain = {name: value for name, value in given.items() if "." not in name}
    for name in plain:
        if name not in known:
            raise SettingsError(f"parameters: there is no parameter '{name}'; known are {', '.join(sorted(known))}")
    mine = {f.name for f in fields(parameters_type)}  # type: ignore[arg-type]  # all are dataclasses
    values = {name: tuple_of_list(value) for name, value in plain.items() if name in mine}
    return settings_from_mapping(parameters_type, values, SOURCE)


def declare(node: Node, settings: object, group: str = "") -> None:
    """Declare the settings of a dataclass with their descriptions and ranges.

    None is read only by its description: which may be changed, and when, ``live_parameters`` says with the reason.
    """
    for description in describe(type(settings)):
        name = f"{group}.{description.name}" if group else description.name
        value = getattr(settings, description.name)
        # ROS takes an empty list for a list of bytes.
        value = list(value) or [""] if isinstance(value, tuple) else value
        node.declare_parameter(name, value, _descriptor(description), ignore_override=True)


def _descriptor(description: SettingDescription) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=description.text() + (", live" if description.is_live else ""))
    if description.low is not None and description.high is not None:
        if description.type is float:
            limits = FloatingPointRange(from_value=description.low, to_value=description.high)
            descriptor.floating_point_range = [limits]
        else:
            low, high = int(description.low), int(description.high)
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
    return descriptor


def tuple_of_list(value: Any) -> Any:
    """A list of ROS as a setting has it; an empty one comes as one of an empty word."""
    if isinstance(value, (list, tuple)):
        return tuple(element for element in value if element != "")
    return value
