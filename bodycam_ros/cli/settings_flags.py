"""Settings as flags: ``--tracker.max_track_age 2.0``."""

import argparse
import os
from collections.abc import Callable
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bodycam_ros.cli.command_parser import CommandParser
from bodycam_ros.errors import SettingsError
from bodycam_ros.settings import SettingDescription, SettingsGroups, describe, read_settings_file, settings_from_mapping
from bodycam_ros.shown import shown

G = TypeVar("G", bound=SettingsGroups)

_BOOLEAN = {"true": True, "false": False}


def offer_settings(parser: argparse.ArgumentParser, load: Callable[[], type[SettingsGroups]]) -> None:
    """Add the flags of settings once one of them is given, where the parser can wait.

    Args:
        parser: of a command.
        load: imports the groups, which takes a second where they are the whole pipeline's.
    """
    if isinstance(parser, CommandParser):
        parser.add_later(lambda: add_settings_flags(parser, load()))
    else:
        add_settings_flags(parser, load())


def add_settings_flags(parser: argparse.ArgumentParser, groups_type: type[SettingsGroups]) -> None:
    """Add a flag ``--group.field VALUE`` for each setting, with its reason, unit, range and default as help."""
    for group, settings_type in groups_type.groups().items():
        flags = parser.add_argument_group(f"settings of {group}")
        for description in describe(settings_type):
            flags.add_argument(
                f"--{group}.{description.name}",
                type=_boolean if description.type is bool else partial(_value, description),
                metavar="|".join([_kind(description.type), *description.words]),
                help=f"{description.text()}; default {description.default}".replace("%", "%%"),
            )


def settings_from_flags(arguments: argparse.Namespace, groups_type: type[G], config: Path | None = None) -> G:
    """Settings of all groups: the defaults, over them the parameter file, over that the flags.

    Args:
        arguments: parsed flags of ``add_settings_flags`` for the same groups, if any was given.
        config: ROS parameter file (``/**: ros__parameters:``); groups that it lacks keep their defaults.

    Raises:
        SettingsError: unknown name, wrong type or value out of range, in the file or in a flag.
    """
    of_file = {} if config is None else _read_known_groups(config, groups_type)
    settings: dict[str, Any] = {}
    for group, settings_type in groups_type.groups().items():
        values = of_file.get(group, {})
        # On its own, lest a flag is blamed for what the file has wrong, or hides it.
        settings_from_mapping(settings_type, values, f"{config}: {group}")
        flags = {
            description.name: given
            for description in describe(settings_type)
            if (given := getattr(arguments, f"{group}.{description.name}", None)) is not None
        }
        settings[group] = settings_from_mapping(settings_type, values | flags, f"--{group}")
    return groups_type(**settings)


def _read_known_groups(config: Path, groups_type: type[SettingsGroups]) -> dict[str, dict[str, Any]]:
    """Groups of a parameter file, which one file may hold for every command: each takes its own.

    Raises:
        SettingsError: a group that no command has.
    """
    of_file = read_settings_file(config)
    if of_file.keys() - groups_type.groups().keys():
        from bodycam_ros.all_settings import all_groups

        known = all_groups() | groups_type.groups()
        for group in of_file:
            if group not in known:
                alike = get_close_matches(group, known, n=1)
                meant = f"; is '{alike[0]}' meant?" if alike else f"; known are {', '.join(sorted(known))}"
                raise SettingsError(f"{config}: there is no group {shown(group)}{meant}")
    return of_file


def _kind(value_type: type) -> str:
    return "true|false" if value_type is bool else value_type.__name__.upper()


def _value(description: SettingDescription, text: str) -> Any:
    if text in description.words:
        return text
    try:
        return description.type(text)
    except ValueError as error:
        words = "".join(f" or {word}" for word in description.words)
        raise argparse.ArgumentTypeError(f"expected {description.type.__name__}{words}, not '{text}'") from error


def _boolean(text: str) -> bool:
    if text.lower() not in _BOOLEAN:
        raise argparse.ArgumentTypeError(f"expected true or false, not '{text}'")
    return _BOOLEAN[text.lower()]


if TYPE_CHECKING:
    from bodycam_ros.pipeline_settings import PipelineSettings


def add_pipeline_flags(parser: argparse.ArgumentParser, map_is_optional: bool = False) -> None:
    """Add BAG, --map, --body, --jobs, --config and a flag for every setting."""
    add_recording_flags(parser, map_is_optional=map_is_optional)
    parser.add_argument(
        "--body", type=Path, required=True, help="body YAML, made by 'bodycam body': segments, joints, camera mounts"
    )


def add_recording_flags(parser: argparse.ArgumentParser, with_map: bool = True, map_is_optional: bool = False) -> None:
    """Add BAG, --map unless that is given otherwise, --jobs, --config and a flag for every setting."""
    parser.add_argument("recording", type=Path, metavar="BAG", help="ros2 bag folder or .mcap file with the cameras")
    if with_map:
        needed = not map_is_optional
        parser.add_argument("--map", type=Path, required=needed, help="reference map, a folder made by 'bodycam map'")
    add_jobs(parser, "processes for the cameras")
    parser.add_argument("--config", type=Path, help="ROS parameter YAML with settings; flags win over it")
    offer_settings(parser, _all_stages)


def add_imu_flag(parser: argparse.ArgumentParser) -> None:
    """Add --imu: bags with inertial sensors beside the recording."""
    parser.add_argument(
        "--imu",
        type=Path,
        action="append",
        default=[],
        metavar="BAG",
        help="bag with /<camera>/imu of the same recording, where BAG itself has none; may be given several times",
    )


def pipeline_settings(arguments: argparse.Namespace) -> "PipelineSettings":
    """Settings of all stages from defaults, the file of --config, and flags, the later the stronger.

    Raises:
        SettingsError: a value that is unknown or out of range.
    """
    return settings_from_flags(arguments, _all_stages(), arguments.config)


def _all_stages() -> "type[PipelineSettings]":
    from bodycam_ros.pipeline_settings import PipelineSettings

    return PipelineSettings


def add_jobs(parser: argparse.ArgumentParser, what: str) -> None:
    """Add --jobs: how many of something work at a time."""
    parser.add_argument("--jobs", type=positive, default=os.cpu_count() or 1, help=f"{what} (default: all cores)")


def positive(text: str) -> int:
    """A number of processes or passes; argparse says what is wrong with another."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number
