"""Settings as ROS parameters: declared with description and range, checked as in a file, changed where possible."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, Generic, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from bodycam_ros.errors import SettingsError
from bodycam_ros.live.node_parameters import ALL, GROUPS
from bodycam_ros.settings import SettingDescription, SettingsGroups, describe, settings_from_mapping

P = TypeVar("P")
S = TypeVar("S", bound=SettingsGroups)

SOURCE: Final = "parameters"

_AT_BIRTH: Final = ("autostart", "frame_prefix", "moments")
"""Own parameters that are read when a node is made, before it is configured."""


class NodeParameters(Generic[P]):
    """The parameters of a node: its own, and the groups of settings that its stage uses.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``.
        own_type: dataclass of its own parameters.
        settings: groups of settings, of which ``names`` are used.
        names: of these groups.

    Attributes:
        own: the node's own parameters.
        is_configured: whether a configuration has read those that cannot change any more.

    Raises:
        SettingsError: a value of the wrong type, or out of its range.
    """

    def __init__(
        self, node: Node, own_type: type[P], settings: Sequence[SettingsGroups] = (), names: Iterable[str] = ()
    ) -> None:
        self._settings = {type(each): each for each in settings}
        self._of = {group: kind for kind in self._settings for group in kind.groups() if group in {*names}}
        self.is_configured = False
        self._changed: Callable[[], None] = lambda: None
        given = _given(node)
        plain = {name: tuple_of_list(value) for name, value in given.items() if "." not in name}
        own_names = {f.name for f in fields(own_type)}  # type: ignore[arg-type]  # all are dataclasses
        self.own = settings_from_mapping(own_type, {n: v for n, v in plain.items() if n in own_names}, SOURCE)
        grouped: defaultdict[str, dict[str, Any]] = defaultdict(dict)
        for name, value in given.items():
            group, dot, setting_name = name.partition(".")
            if dot:
                grouped[group][setting_name] = value
        unknown = plain.keys() - {f.name for each in ALL for f in fields(each)}
        unknown |= {f"{group}.{name}" for group in grouped.keys() - GROUPS for name in grouped[group]}
        for group, values in ((group, values) for group, values in grouped.items() if group in self._of):
            known = {each.name for each in describe(self._of[group].groups()[group])}
            unknown |= {f"{group}.{name}" for name in values.keys() - known}
            self._replace(group, {name: value for name, value in values.items() if name in known})
        for name in sorted(unknown):
            node.get_logger().warning(f"there is no parameter '{name}'; it changes nothing")
        _declare(node, self.own)
        for group, kind in self._of.items():
            _declare(node, getattr(self._settings[kind], group), f"{group}.")
        self._pending: tuple[P, dict[type[SettingsGroups], SettingsGroups]] | None = None
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    def of(self, settings_type: type[S]) -> S:
        """The settings of one kind, as they are now."""
        settings: S = self._settings[settings_type]  # type: ignore[assignment]  # keyed by its type
        return settings

    def on_change(self, changed: Callable[[], None]) -> None:
        """Call back after values have changed."""
        self._changed = changed

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

    def _replace(self, group: str, values: Mapping[str, Any]) -> None:
        kind = self._of[group]
        before = getattr(self._settings[kind], group)
        of_group = _changed(before, values, f"{SOURCE}: {group}")
        self._settings[kind] = replace(self._settings[kind], **{group: of_group})

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse what cannot change now, or not to this."""
        own, settings = self.own, dict(self._settings)
        try:
            for each in parameters:
                group, dot, name = each.name.rpartition(".")
                if dot and group in self._of:
                    kind = self._of[group]
                    of_group = self._one(getattr(settings[kind], group), each.name, name, each.value)
                    settings[kind] = replace(settings[kind], **{group: of_group})
                elif not dot and hasattr(own, name):
                    own = self._one(own, each.name, name, each.value)
        except SettingsError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._pending = own, settings
        return SetParametersResult(successful=True)

    def _one(self, of: Any, full_name: str, name: str, value: Any) -> Any:
        description = next(each for each in describe(type(of)) if each.name == name)
        if not description.is_live and (self.is_configured or full_name in _AT_BIRTH):
            raise SettingsError(
                f"{SOURCE}: {full_name} is read when the node is "
                f"{'started' if full_name in _AT_BIRTH else 'configured'}; restart it with -p {full_name}:=VALUE"
            )
        return _changed(of, {name: value}, SOURCE)

    def _take(self, parameters: list[Parameter]) -> None:
        if self._pending is not None:
            (self.own, self._settings), self._pending = self._pending, None
            self._changed()


def tuple_of_list(value: Any) -> Any:
    """A list of ROS as a setting has it; an empty one comes as one of an empty word."""
    return tuple(element for element in value if element != "") if isinstance(value, (list, tuple)) else value


def _changed(of: Any, values: Mapping[str, Any], source: str) -> Any:
    before = {f.name: getattr(of, f.name) for f in fields(of)}
    return settings_from_mapping(type(of), before | {n: tuple_of_list(v) for n, v in values.items()}, source)


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
