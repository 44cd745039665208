"""Settings as ROS parameters: declared with description and range, checked as in a file, changed where possible.

A reader's depth bounds how far its node may fall behind before it loses messages; a writer's, how far behind its
slowest reader may be.
"""

import array
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from functools import cache
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

from numpy.typing import NDArray
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.errors import SettingsError
from bodycam_ros.files.shown import shown
from bodycam_ros.graph.node_parameters import ALL, GROUPS
from bodycam_ros.messages.factory import Message, MessageFactory, array_sequence
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.settings import SettingDescription, check_name, describe

P = TypeVar("P")

_SOURCE = "parameters"
_FIXED_AT_START = ("autostart", "frame_prefix", "moments")
"""Own parameters that are read when a node is made, before it is configured."""


class NodeParameters(Generic[P]):
    """The parameters of a node: its own, and the groups of settings that its stage uses.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``.
        own_type: dataclass of the node's own parameters.
        groups: names of these groups.

    Attributes:
        own: the node's own parameters, as they are now.
        settings: of all stages, as they are now; groups that are not used have their defaults.
        on_change: called after values have changed.
        is_configured: whether a configuration has read those that cannot change any more.

    Raises:
        SettingsError: a value of the wrong type, or out of its range.
    """

    def __init__(self, node: Node, own_type: type[P], groups: Collection[str] = ()) -> None:
        self.is_configured = False
        self.on_change: Callable[[], None] = lambda: None
        of_groups = {name: kind for name, kind in PipelineSettings.groups().items() if name in groups}
        # Without the name of a group the node's own.
        self._kinds: dict[str, Any] = {"": own_type, **of_groups}
        self._described = {
            _full_name(group, each.name): each for group, kind in self._kinds.items() for each in describe(kind)
        }
        values = {name: each.default for name, each in self._described.items()}
        of_others = {f.name for each in ALL for f in fields(each)}
        for name, value in _given(node).items():
            group = name.rpartition(".")[0]
            check_name(name.partition(".")[0], _SOURCE)
            if name in values:
                values[name] = self._checked(name, value)
            elif group in of_groups or (group not in GROUPS and name not in of_others):
                node.get_logger().warning(f"there is no parameter '{name}'; it changes nothing")
        self._use(values)
        for name, value in values.items():
            # ROS takes an empty list for a list of bytes.
            value = list(value) or [""] if isinstance(value, tuple) else value
            node.declare_parameter(name, value, _descriptor(self._described[name]), ignore_override=True)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    def required(self, name: str) -> str:
        """The value of an own parameter that has no default.

        Raises:
            SettingsError: it is empty.
        """
        value: str = getattr(self.own, name)
        if not value:
            reason = self._described[name].reason
            raise SettingsError(f"the parameter '{name}' is missing ({reason}); give it with --ros-args -p {name}:=...")
        return value

    def _use(self, values: dict[str, Any]) -> None:
        self._values = values
        made = {
            group: kind(**{f.name: values[_full_name(group, f.name)] for f in fields(kind)})
            for group, kind in self._kinds.items()
        }
        self.own: P = made.pop("")
        self.settings = PipelineSettings(**made)

    def _checked(self, full_name: str, value: Any) -> Any:
        """A value in the type of its setting; an empty list of ROS comes as one of an empty word."""
        value = tuple(each for each in value if each != "") if isinstance(value, (list, tuple)) else value
        group = full_name.rpartition(".")[0]
        return self._described[full_name].check(value, f"{_SOURCE}: {group}" if group else _SOURCE)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Reject what cannot change now, or not to this; names that are not of the node are rclpy's."""
        try:
            for each in parameters:
                if each.name in self._values:
                    if self.is_configured and not self._described[each.name].is_live:
                        hint = f"is read when the node is configured; restart it with -p {each.name}:=VALUE"
                        raise SettingsError(f"{_SOURCE}: {each.name} {hint}")
                    self._checked(each.name, each.value)
        except SettingsError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        own = [each for each in parameters if each.name in self._values]
        self._use(self._values | {each.name: self._checked(each.name, each.value) for each in own})
        self.on_change()


def _full_name(group: str, name: str) -> str:
    return f"{group}.{name}" if group else name


def _given(node: Node) -> dict[str, Any]:
    """What parameter files and the command line set; afterwards the node has none of it, and all can be declared."""
    there: Mapping[str, Any] = node.get_parameters_by_prefix("")  # rclpy annotates them as values
    given = {}
    for name, parameter in there.items():
        if name in ("use_sim_time", "start_type_description_service"):
            continue
        node.undeclare_parameter(name)
        # rclpy declares these with their topics, and takes the values again.
        if not name.startswith("qos_overrides."):
            given[name] = parameter.value
    return given


def _descriptor(description: SettingDescription) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=description.text() + (", live" if description.is_live else ""))
    descriptor.read_only = description.name in _FIXED_AT_START
    # A setting that may be a word in place of a number has the type of what it is now.
    descriptor.dynamic_typing = bool(description.words)
    if description.low is not None and description.high is not None and not description.words:
        low, high = description.low, description.high
        if description.type is float:
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        else:
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


STAGE_DEPTH = 1000
"""Between stages: 33 s of one camera at 30 Hz, 10 MB. The registration of 16 cameras bears long bursts with it."""

OUTPUT_DEPTH = 200
"""Queue of what the solver publishes: a flush sends a whole window at once."""


def reliable(depth: int) -> QoSProfile:
    """Reliable delivery to the subscriptions that are there."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def best_effort(depth: int) -> QoSProfile:
    """Quality of service that matches every driver's publisher: best effort."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def latched(depth: int = 1) -> QoSProfile:
    """The latest messages also reach those that come later."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


_PREFIX = re.compile(r"(?:[A-Za-z_][\w.-]*/)*(?:[A-Za-z_][\w.-]*)?", re.ASCII)


@cache
def message_class(type_name: str) -> Any:
    """Class of a type such as "sensor_msgs/msg/JointState".

    Raises:
        SettingsError: its package is missing.
    """
    package, _, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ModuleNotFoundError as error:
        # Of ROS' packages foxglove_msgs is the one that installations lack.
        ubuntu = f"ros-jazzy-{package.replace('_', '-')}"
        raise SettingsError(f"{type_name} needs the ROS package {package}: sudo apt install {ubuntu}") from error


class _RclpyMessages:
    """Messages that rclpy publishes."""

    def message_class(self, type_name: str) -> Callable[..., Message]:
        return cast(Callable[..., Message], message_class(type_name))

    def sequence(self, values: NDArray[Any]) -> "array.array[Any]":
        return array_sequence(values)

    def byte(self, value: int) -> bytes:
        return bytes([value])


def node_messages(frame_prefix: str = "") -> MessageFactory:
    """Makes messages that rclpy publishes.

    Raises:
        SettingsError: no frame may start with the prefix: tf2 rejects a slash in front, and names are ASCII.
    """
    if not _PREFIX.fullmatch(frame_prefix):
        raise SettingsError(
            "the parameter 'frame_prefix' must be letters, digits and slashes, none in front, such as anna/; not "
            f"{shown(frame_prefix)}"
        )
    return MessageFactory(_RclpyMessages(), frame_prefix)
