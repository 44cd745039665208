"""Settings of a stage: frozen dataclasses whose fields carry unit, range and reason. msgspec checks their values.

One name serves YAML file, ROS parameter and command-line flag alike: the group and the field
joined by a dot, such as ``registrar.min_inliers``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import msgspec

from bodycam_ros.errors import SettingsError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.yaml_file import read_yaml

S = TypeVar("S")

RENAMED: Final = {"smoother": "estimator", "growth": "extension", "extend": "extension", "worn": "body_cameras"}
"""Group of settings, or parameter, as it was called -> as it is called."""


def check_name(name: str, source: str) -> None:
    """Refuse a group of settings, or a parameter, that has another name by now.

    Raises:
        SettingsError: it has; the message has the new name.
    """
    if name in RENAMED:
        raise SettingsError(f"{source}: {name} is called {RENAMED[name]} now; rename it there")


@dataclass(frozen=True)
class SettingDescription:
    """One setting as a person reads it: in ``--help``, in ``ros2 param describe``, in an error.

    Where ``is_live``, a node takes another value while it works.
    """

    name: str
    type: type
    default: Any
    unit: str
    low: float | None
    high: float | None
    words: tuple[str, ...]
    reason: str
    is_live: bool

    def text(self) -> str:
        """Reason, unit and range in one line."""
        unit = f" [{self.unit}]" if self.unit else ""
        words = "".join(f", or '{word}'" for word in self.words)
        limits = "" if self.low is None else f" ({self.low:g} to {self.high:g}{words})"
        return f"{self.reason}{unit}{limits}"

    def check(self, value: Any, source: str, *, is_text: bool = False) -> Any:
        """The value in the setting's type; ``source`` is for messages. Text of a command line may be a number.

        Raises:
            SettingsError: wrong type, or out of the range.
        """
        try:
            return msgspec.convert(value, self._constrained(), strict=not is_text)
        except (msgspec.ValidationError, OverflowError) as error:
            problem = str(error).replace("`", "")
            raise SettingsError(f"{source}: {self.name} = {shown(value)}: {problem}; {self.text()}") from error

    def _constrained(self) -> Any:
        kind: Any = tuple[str, ...] if self.type is tuple else self.type
        if self.low is not None:
            whole = self.type is int
            low, high = (int(limit) if whole else limit for limit in (self.low, self.high or 0.0))
            kind = Annotated[kind, msgspec.Meta(ge=low, le=high)]
        return kind | Literal[self.words] if self.words else kind


def setting(
    default: Any,
    *,
    unit: str = "",
    limits: tuple[float, float] | None = None,
    words: tuple[str, ...] = (),
    reason: str,
    live: bool = False,
) -> Any:
    """A dataclass field with its unit, its inclusive limits and why it has its default.

    Args:
        words: allowed in place of a number.
        reason: what it does; what raising it does.
        live: a running node takes another value.
    """
    low, high = limits or (None, None)
    metadata = {"unit": unit, "low": low, "high": high, "words": words, "reason": reason, "is_live": live}
    return field(default=default, metadata=metadata)


def describe(settings_type: type) -> Iterator[SettingDescription]:
    """Yield the settings of a settings dataclass in order of declaration."""
    for f in fields(settings_type):
        if f.default is MISSING:
            raise TypeError(f"{settings_type.__name__}.{f.name} has no default")
        yield SettingDescription(f.name, type(f.default), f.default, **f.metadata)


def settings_from_mapping(
    settings_type: type[S], values: Mapping[str, Any], source: str, *, is_text: bool = False
) -> S:
    """Build settings from plain values, checked against type and range.

    Args:
        settings_type: a frozen dataclass whose fields were made by ``setting``.
        values: field name -> value; fields that are absent keep their default.
        source: where the values come from, for messages ("config.yaml: tracker").
        is_text: numbers may be text, as on a command line.

    Raises:
        SettingsError: unknown name, wrong type, or value outside the range.
    """
    known = {s.name: s for s in describe(settings_type)}
    for name in values:
        if name not in known:
            raise SettingsError(f"{source}: there is no setting {shown(name)}; {other_than(name, sorted(known))}")
    return settings_type(**{name: known[name].check(value, source, is_text=is_text) for name, value in values.items()})


@dataclass(frozen=True)
class SettingsGroups:
    """The settings of several steps: each field of a derived dataclass is a group, and its default that group's.

    The field's name is the group's in YAML, ROS parameters and flags (``registrar.min_inliers``).
    """

    @classmethod
    def groups(cls) -> dict[str, type]:
        """Group -> its settings dataclass."""
        defaults = cls()
        return {f.name: type(getattr(defaults, f.name)) for f in fields(cls)}

    def as_mapping(self) -> dict[str, dict[str, Any]]:
        """Group -> setting -> value."""
        return asdict(self)


def read_settings_file(path: Path) -> dict[str, dict[str, Any]]:
    """Read a ROS parameter file (``/**: ros__parameters:``) into group -> setting -> value.

    Raises:
        SettingsError: the file is missing, not YAML, or not in the form of a ROS parameter file.
    """
    document = read_yaml(path, "settings file", SettingsError)
    try:
        parameters = document["/**"]["ros__parameters"].items()
    except (TypeError, KeyError, AttributeError) as error:
        raise SettingsError(f"{path}: expected a ROS parameter file with '/**: ros__parameters:' on top") from error
    groups: dict[str, dict[str, Any]] = {}
    for name, value in parameters:
        if not isinstance(name, str):
            raise SettingsError(f"{path}: {shown(name)} is no name of a group of settings")
        # ROS has two spellings: a mapping under the group's name, and the group joined to the setting by a dot.
        check_name(name.partition(".")[0], str(path))
        if isinstance(value, dict):
            groups.setdefault(name, {}).update(value)
        elif "." in name:
            group, setting_name = name.split(".", 1)
            groups.setdefault(group, {})[setting_name] = value
    return groups
