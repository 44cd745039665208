"""ROS parameters from settings dataclasses: one name and one check for YAML, command line and ``ros2 param``."""

from collections import defaultdict
from dataclasses import fields
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes import node_parameters
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.settings import SettingDescription, describe, settings_from_mapping

P = TypeVar("P")

_SOURCE = "parameters"

_ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""First parts of the names of parameters that rclpy declares for every node."""


def given_parameters(node: Node) -> dict[str, Any]:
    """What parameter files and the command line say, whoever it is meant for.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``; afterwards it has none of these
            parameters any more, so that they can be declared with their descriptions.
    """
    given = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name.split(".")[0] not in _ROS_OWN
    }
    for name in given:
        node.undeclare_parameter(name)
    return given


def settings_from_parameters(given: dict[str, Any]) -> tuple[PipelineSettings, CalibrationSettings]:
    """Settings of all stages, and of the calibration, from parameters named ``group.setting``.

    Raises:
        SettingsError: an unknown name, a wrong type, or a value out of range.
    """
    grouped: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for name, value in given.items():
        group, dot, setting_name = name.partition(".")
        if dot:
            grouped[group][setting_name] = value
    calibration = {group: grouped.pop(group) for group in CalibrationSettings.groups().keys() & grouped.keys()}
    return PipelineSettings.from_mapping(grouped, _SOURCE), CalibrationSettings.from_mapping(calibration, _SOURCE)


def own_parameters(given: dict[str, Any], parameters_type: type[P]) -> P:
    """The node's own parameters, which have no group.

    Raises:
        SettingsError: no node has such a parameter, a wrong type, or a value out of range.
    """
    known = {f.name for each in node_parameters.ALL for f in fields(each)}
    plain = {name: value for name, value in given.items() if "." not in name}
    for name in plain:
        if name not in known:
            raise SettingsError(f"parameters: there is no parameter '{name}'; known are {', '.join(sorted(known))}")
    mine = {f.name for f in fields(parameters_type)}
    values = {name: _tuple_of_list(value) for name, value in plain.items() if name in mine}
    return settings_from_mapping(parameters_type, values, _SOURCE)


def declare(node: Node, settings: object, group: str = "") -> None:
    """Declare the settings of a dataclass with their descriptions and ranges; they are fixed from now on."""
    for description in describe(type(settings)):
        name = f"{group}.{description.name}" if group else description.name
        value = getattr(settings, description.name)
        # ROS takes an empty list for a list of bytes.
        value = list(value) or [""] if isinstance(value, tuple) else value
        node.declare_parameter(name, value, _descriptor(description), ignore_override=True)


def _descriptor(description: SettingDescription) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=description.text(), read_only=True)
    if description.low is not None and description.high is not None:
        if description.type is float:
            limits = FloatingPointRange(from_value=description.low, to_value=description.high)
            descriptor.floating_point_range = [limits]
        else:
            low, high = int(description.low), int(description.high)
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
    return descriptor


def _tuple_of_list(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return tuple(element for element in value if element != "")
    return value
