"""Settings as ROS parameters: declared with description and range, checked as in a file, changed where possible.

A reader's depth bounds how far its node may fall behind before it loses messages; a writer's, how far behind its
slowest reader may be.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bodycam_ros.errors import SettingsError
from bodycam_ros.live.parameter_values import ParameterValues
from bodycam_ros.messages.factory import MessageFactory, live_messages
from bodycam_ros.settings import SettingDescription, SettingsGroups, describe
from bodycam_ros.shown import shown

P = TypeVar("P")
S = TypeVar("S", bound=SettingsGroups)


class NodeParameters(Generic[P]):
    """The parameters of a node.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``.
        own_type, settings, names: as of ``ParameterValues``.

    Attributes:
        is_configured: whether a configuration has read those that cannot change any more.

    Raises:
        SettingsError: a value of the wrong type, or out of its range.
    """

    def __init__(
        self, node: Node, own_type: type[P], settings: Sequence[SettingsGroups] = (), names: Iterable[str] = ()
    ) -> None:
        self.is_configured = False
        self._on_change: Callable[[], None] = lambda: None
        self._values = values = ParameterValues(own_type, settings, names, _given(node))
        self._pending: ParameterValues[P] | None = None
        for name in values.unknown:
            node.get_logger().warning(f"there is no parameter '{name}'; it changes nothing")
        _declare(node, values.own)
        for group, kind in values.of_group.items():
            _declare(node, getattr(values.settings[kind], group), f"{group}.")
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    @property
    def own(self) -> P:
        """The node's own parameters, as they are now."""
        return self._values.own

    def of(self, settings_type: type[S]) -> S:
        """The settings of one kind, as they are now."""
        return self._values.of(settings_type)

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

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse what cannot change now, or not to this."""
        try:
            self._pending = self._values.changed({each.name: each.value for each in parameters}, self.is_configured)
        except SettingsError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        if self._pending is not None:
            self._values, self._pending = self._pending, None
            self._on_change()


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
        SettingsError: no frame may begin with the prefix: tf2 refuses a slash in front, and names are ASCII.
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
