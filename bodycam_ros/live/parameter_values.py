"""The values of a node's parameters: its own, and the groups of settings that its stage uses."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, Generic, TypeVar

from bodycam_ros.errors import SettingsError
from bodycam_ros.live.node_parameters import ALL, GROUPS
from bodycam_ros.settings import SettingsGroups, describe, settings_from_mapping

P = TypeVar("P")
S = TypeVar("S", bound=SettingsGroups)

SOURCE: Final = "parameters"

_AT_BIRTH: Final = ("autostart", "frame_prefix", "moments")
"""Own parameters that are read when a node is made, before it is configured."""


class ParameterValues(Generic[P]):
    """Values by full names such as ``registrar.min_inliers``; nothing changes in place.

    Args:
        own_type: dataclass of the node's own parameters.
        settings: groups of settings, of which ``names`` are used.
        names: of these groups.
        given: full name -> value, where it is not the default.

    Attributes:
        own: the node's own parameters.
        settings: by type.
        of_group: type by the name of its group.
        unknown: what was given, but no node or command has.

    Raises:
        SettingsError: a value of the wrong type, or out of its range.
    """

    def __init__(
        self, own_type: type[P], settings: Sequence[SettingsGroups], names: Iterable[str], given: Mapping[str, Any]
    ) -> None:
        self.settings: dict[type[SettingsGroups], SettingsGroups] = {type(each): each for each in settings}
        self.of_group = {group: kind for kind in self.settings for group in kind.groups() if group in {*names}}
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
        for group, values in ((group, values) for group, values in grouped.items() if group in self.of_group):
            known = {each.name for each in describe(self.of_group[group].groups()[group])}
            unknown |= {f"{group}.{name}" for name in values.keys() - known}
            self._change(group, {name: value for name, value in values.items() if name in known})
        self.unknown = sorted(unknown)

    def of(self, settings_type: type[S]) -> S:
        """The settings of one kind."""
        settings: S = self.settings[settings_type]  # type: ignore[assignment]  # keyed by its type
        return settings

    def changed(self, values: Mapping[str, Any], is_configured: bool) -> "ParameterValues[P]":
        """A copy with other values; names that it does not have are left out.

        Args:
            values: by full name.
            is_configured: whether a configuration has read those that cannot change any more.

        Raises:
            SettingsError: a value cannot change now, or not to this.
        """
        copy: ParameterValues[P] = object.__new__(ParameterValues)
        copy.own, copy.settings, copy.of_group, copy.unknown = self.own, dict(self.settings), self.of_group, []
        for full_name, value in values.items():
            group, dot, name = full_name.rpartition(".")
            if dot and group in self.of_group:
                self._check(self.of_group[group].groups()[group], full_name, name, is_configured)
                copy._change(group, {name: value})
            elif not dot and hasattr(self.own, name):
                self._check(type(self.own), full_name, name, is_configured)
                copy.own = _replaced(copy.own, {name: value}, SOURCE)
        return copy

    def _check(self, of: type, full_name: str, name: str, is_configured: bool) -> None:
        description = next(each for each in describe(of) if each.name == name)
        at_birth = full_name in _AT_BIRTH
        if not description.is_live and (is_configured or at_birth):
            raise SettingsError(
                f"{SOURCE}: {full_name} is read when the node is {'started' if at_birth else 'configured'}; "
                f"restart it with -p {full_name}:=VALUE"
            )

    def _change(self, group: str, values: Mapping[str, Any]) -> None:
        kind = self.of_group[group]
        of_group = _replaced(getattr(self.settings[kind], group), values, f"{SOURCE}: {group}")
        self.settings[kind] = replace(self.settings[kind], **{group: of_group})


def tuple_of_list(value: Any) -> Any:
    """A list of ROS as a setting has it; an empty one comes as one of an empty word."""
    return tuple(element for element in value if element != "") if isinstance(value, (list, tuple)) else value


def _replaced(of: Any, values: Mapping[str, Any], source: str) -> Any:
    before = {f.name: getattr(of, f.name) for f in fields(of)}
    return settings_from_mapping(type(of), before | {n: tuple_of_list(v) for n, v in values.items()}, source)
