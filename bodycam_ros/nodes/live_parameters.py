"""Parameters of a node that may be changed: those that are read at each use, and those that a configuration reads."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Generic, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from bodycam_ros.all_settings import all_groups
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes.parameters import SOURCE, tuple_of_list
from bodycam_ros.nodes.qos_overrides import PREFIX
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.settings import describe, settings_from_mapping

P = TypeVar("P")

AT_BIRTH: Final = ("autostart", "frame_prefix", "moments")
"""Own parameters that are read when a node is made, before it is configured."""


@dataclass(frozen=True)
class NodeSettings(Generic[P]):
    """All that the parameters of a node say.

    Attributes:
        own: of the node itself.
        pipeline: of all stages.
        calibration: of the calibration of a body.
    """

    own: P
    pipeline: PipelineSettings
    calibration: CalibrationSettings

    def changed(self, name: str, value: Any, is_configured: bool) -> "NodeSettings[P]":
        """The same with another value of one parameter.

        Args:
            name: of the parameter, as ``group.setting`` or an own one.
            value: as it was given.
            is_configured: whether the node has read those that a configuration reads.

        Raises:
            SettingsError: it cannot be changed now, or not to this; said as it is of a file.
        """
        group, dot, setting_name = name.rpartition(".")
        if not dot:
            return replace(self, own=_changed(self.own, name, setting_name, value, is_configured, SOURCE))
        of = "calibration" if group in CalibrationSettings.groups() else "pipeline"
        groups = getattr(self, of)
        source = f"{SOURCE}: {group}"
        changed = _changed(getattr(groups, group), name, setting_name, value, is_configured, source)
        with_it: NodeSettings[P] = replace(self, **{of: replace(groups, **{group: changed})})
        with_it.pipeline.smoother.check_live()
        return with_it

    def value(self, name: str) -> Any:
        """Value of a parameter, as ROS has it."""
        group, dot, setting_name = name.rpartition(".")
        of = self.calibration if group in CalibrationSettings.groups() else self.pipeline
        return getattr(getattr(of, group) if dot else self.own, setting_name)


def change(
    node: Node, settings: NodeSettings[P], given: Sequence[Parameter], is_configured: bool
) -> tuple[NodeSettings[P], list[Parameter]]:
    """Settings with the parameters of this package that somebody changes, and all that ROS is to set.

    Raises:
        SettingsError: one cannot be changed now, or not to this; none is changed then.
    """
    to_set = []
    for each in given:
        if each.name.startswith(f"{PREFIX}."):
            raise SettingsError(f"{SOURCE}: {each.name} is fixed once the topic is there; {_restart(each)}")
        is_there = node.has_parameter(each.name)
        if not (is_there and _is_ours(each.name, settings)):
            if is_there and each.name.partition(".")[0] in all_groups():
                raise _fixed_at_birth(each.name, SOURCE)
            to_set.append(each)
            continue
        settings = settings.changed(each.name, each.value, is_configured)
        value = settings.value(each.name)
        to_set.append(each if isinstance(value, tuple) else Parameter(each.name, value=value))
    return settings, to_set


def refused(error: SettingsError) -> SetParametersResult:
    """For ROS."""
    return SetParametersResult(successful=False, reason=str(error))


def _is_ours(name: str, settings: NodeSettings[Any]) -> bool:
    group, dot, _ = name.rpartition(".")
    known = {*PipelineSettings.groups(), *CalibrationSettings.groups()}
    return group in known if dot else name in {f.name for f in fields(settings.own)}


def _changed(of: Any, name: str, setting_name: str, value: Any, is_configured: bool, source: str) -> Any:
    description = next((each for each in describe(type(of)) if each.name == setting_name), None)
    if description is not None and not description.is_live:
        if name in AT_BIRTH:
            raise _fixed_at_birth(name, source)
        if is_configured:
            raise SettingsError(
                f"{source}: {name} is fixed once the node is configured; restart it with -p {name}:=VALUE, or set it "
                "between 'ros2 lifecycle set NODE cleanup' and 'configure'"
            )
    before = {f.name: getattr(of, f.name) for f in fields(of)}
    return settings_from_mapping(type(of), before | {setting_name: tuple_of_list(value)}, source)


def _fixed_at_birth(name: str, source: str) -> SettingsError:
    return SettingsError(f"{source}: {name} is fixed when the node starts; restart it with -p {name}:=VALUE")


def _restart(parameter: Parameter) -> str:
    return f"restart the node with -p {parameter.name}:={parameter.value}"
