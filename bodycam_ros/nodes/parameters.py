"""Settings as ROS parameters: declared with description and range, checked as in a file, changed where possible.

A reader's depth bounds how far its node may fall behind before it loses messages; a writer's, how far behind its
slowest reader may be.
"""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.errors import SettingsError
from bodycam_ros.live.node_parameters import ALL, GROUPS
from bodycam_ros.messages.factory import MessageFactory, live_messages
from bodycam_ros.settings import SettingDescription, SettingsGroups, describe, settings_from_mapping
from bodycam_ros.shown import shown

P = TypeVar("P")
S = TypeVar("S", bound=SettingsGroups)

_SOURCE = "parameters"
_FIXED_AT_START = ("autostart", "frame_prefix", "moments")
"""Own parameters that are read when a node is made, before it is configured."""


class NodeParameters(Generic[P]):
    """The parameters of a node: its own, and the groups of settings that its stage uses.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``.
        own_type: dataclass of the node's own parameters.
        settings_types: types of groups of settings, of which ``groups`` are used.
        groups: names of these groups.

    Attributes:
        is_configured: whether a configuration has read those that cannot change any more.

    Raises:
        SettingsError: a value of the wrong type, or out of its range.
    """

    def __init__(
        self,
        node: Node,
        own_type: type[P],
        settings_types: Sequence[type[SettingsGroups]] = (),
        groups: Collection[str] = (),
    ) -> None:
        self.is_configured = False
        self._on_change: Callable[[], None] = lambda: None
        self._types = settings_types
        # Group -> its settings; without a name the node's own.
        values: dict[str, Any] = {_OWN: own_type()}
        for each in settings_types:
            values |= {name: kind() for name, kind in each.groups().items() if name in groups}
        plain, known_groups = {f.name for each in ALL for f in fields(each)}, GROUPS | {_OWN}
        for full_name, value in _given(node).items():
            group, _, name = full_name.rpartition(".")
            if group in values and hasattr(values[group], name):
                values[group] = _replaced(values[group], group, name, value)
            elif group in values and not (group == _OWN and name in plain) or group not in known_groups:
                node.get_logger().warning(f"there is no parameter '{full_name}'; it changes nothing")
        self._use(values)
        for group, settings in values.items():
            _declare(node, settings, f"{group}." if group else "")
        self._pending: dict[str, Any] | None = None
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    @property
    def own(self) -> P:
        """The node's own parameters, as they are now."""
        own: P = self._values[_OWN]
        return own

    def of(self, settings_type: type[S]) -> S:
        """The settings of one type, as they are now."""
        settings: S = self._settings[settings_type]  # type: ignore[assignment]  # keyed by its type
        return settings

    def on_change(self, changed: Callable[[], None]) -> None:
        """Call back after values have changed."""
        self._on_change = changed

    def required(self, name: str) -> str:
        """The value of an own parameter that has no default.

        Raises:
            SettingsError: it is empty.
        """
        value: str = getattr(self.own, name)
        if not value:
            reason = next(each.reason for each in describe(type(self.own)) if each.name == name)
            raise SettingsError(f"the parameter '{name}' is missing ({reason}); give it with --ros-args -p {name}:=...")
        return value

    def _use(self, values: dict[str, Any]) -> None:
        self._values = values
        self._settings: dict[type[SettingsGroups], SettingsGroups] = {
            each: each(**{name: values[name] for name in each.groups() if name in values}) for each in self._types
        }

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Reject what cannot change now, or not to this; names that are not of the node are rclpy's."""
        values = dict(self._values)
        try:
            for each in parameters:
                group, _, name = each.name.rpartition(".")
                if group in values and hasattr(values[group], name):
                    self._check_changeable(values[group], each.name, name)
                    values[group] = _replaced(values[group], group, name, each.value)
        except SettingsError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._pending = values
        return SetParametersResult(successful=True)

    def _check_changeable(self, settings: Any, full_name: str, name: str) -> None:
        description = next(each for each in describe(type(settings)) if each.name == name)
        at_start = full_name in _FIXED_AT_START
        if not description.is_live and (self.is_configured or at_start):
            raise SettingsError(
                f"{_SOURCE}: {full_name} is read when the node is {'started' if at_start else 'configured'}; "
                f"restart it with -p {full_name}:=VALUE"
            )

    def _take(self, parameters: list[Parameter]) -> None:
        if self._pending is not None:
            self._use(self._pending)
            self._pending = None
            self._on_change()


_OWN = ""
"""In place of a group: the node's own parameters."""


def _replaced(settings: Any, group: str, name: str, value: Any) -> Any:
    """Settings with another value; an empty list of ROS comes as one of an empty word."""
    value = tuple(each for each in value if each != "") if isinstance(value, (list, tuple)) else value
    values = {f.name: getattr(settings, f.name) for f in fields(settings)} | {name: value}
    return settings_from_mapping(type(settings), values, f"{_SOURCE}: {group}" if group else _SOURCE)


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


def _declare(node: Node, settings: object, prefix: str = "") -> None:
    for description in describe(type(settings)):
        value = getattr(settings, description.name)
        # ROS takes an empty list for a list of bytes.
        value = list(value) or [""] if isinstance(value, tuple) else value
        node.declare_parameter(prefix + description.name, value, _descriptor(description), ignore_override=True)


def _descriptor(description: SettingDescription) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=description.text() + (", live" if description.is_live else ""))
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
"""Of what the solver publishes: a flush sends a whole window at once."""


def reliable(depth: int) -> QoSProfile:
    """Reliable delivery to the subscriptions that are there."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


def best_effort(depth: int) -> QoSProfile:
    """What every driver's publisher fits."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def latched(depth: int = 1) -> QoSProfile:
    """The latest messages also reach those that come later."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


TRANSFORMS = "tf2_msgs/msg/TFMessage"
"""On every ROS machine; ROS 2's wheels come without it, and `make test` builds it (msg_defs/tf2_msgs)."""

_PREFIX = re.compile(r"(?:[A-Za-z_][\w.-]*/)*(?:[A-Za-z_][\w.-]*)?", re.ASCII)


def is_installed(type_name: str) -> bool:
    """Whether the package of a message type is there."""
    return find_spec(type_name.split("/")[0]) is not None


@cache
def message_class(type_name: str) -> Any:
    """Class of a type such as "sensor_msgs/msg/JointState"."""
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def node_messages(frame_prefix: str = "") -> MessageFactory:
    """Makes messages that rclpy publishes; transforms come out as None where their package is missing.

    Raises:
        SettingsError: no frame may start with the prefix: tf2 rejects a slash in front, and names are ASCII.
    """
    if not _PREFIX.fullmatch(frame_prefix):
        raise SettingsError(
            "the parameter 'frame_prefix' must be letters, digits and slashes, none in front, such as anna/; not "
            f"{shown(frame_prefix)}"
        )
    return live_messages(_maker, frame_prefix)


def _maker(type_name: str) -> Callable[..., Any]:
    if type_name == TRANSFORMS and not is_installed(type_name):
        return lambda **fields: None
    maker: Callable[..., Any] = message_class(type_name)
    return maker
