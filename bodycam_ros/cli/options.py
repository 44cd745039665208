"""Options that several commands share, and settings as flags: ``--tracker.max_track_age 2.0``."""

import argparse
import os
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from bodycam_ros.cli.command_parser import CommandParser
from bodycam_ros.errors import SettingsError, StationError
from bodycam_ros.settings import SettingDescription, SettingsGroups, describe, read_settings_file, settings_from_mapping
from bodycam_ros.shown import shown

if TYPE_CHECKING:
    from bodycam_ros.pipeline_settings import PipelineSettings

G = TypeVar("G", bound=SettingsGroups)

PIPELINE = "pipeline_settings:PipelineSettings"
"""Settings of all stages, for ``add_config``."""

_BOOLEAN = {"true": True, "false": False}


def add_output(parser: argparse.ArgumentParser, metavar: str, help_text: str, replaced: str | None = None) -> None:
    """Add -o and --force.

    Args:
        replaced: what --force replaces, if not just the output.
    """
    parser.add_argument("-o", "--output", type=Path, required=True, metavar=metavar, help=help_text)
    parser.add_argument("--force", action="store_true", help=f"replace {replaced or metavar} if it exists already")


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add BAG."""
    parser.add_argument("recording", type=Path, metavar="BAG", help="ros2 bag folder or .mcap file with the cameras")


def add_map(parser: argparse._ActionsContainer, required: bool = True) -> None:
    """Add --map."""
    parser.add_argument("--map", type=Path, required=required, help="reference map, a folder made by 'bodycam map'")


def add_imu(parser: argparse._ActionsContainer) -> None:
    """Add --imu."""
    parser.add_argument(
        "--imu",
        type=Path,
        action="append",
        default=[],
        metavar="BAG",
        help="bag with /<camera>/imu of the same recording, where BAG itself has none; may be given several times",
    )


def add_stations(parser: argparse._ActionsContainer, help_text: str) -> None:
    """Add --stations."""
    parser.add_argument("--stations", type=Path, metavar="CAMERAS.YAML", help=help_text)


def add_surface(parser: argparse._ActionsContainer) -> None:
    """Add --surface."""
    parser.add_argument(
        "--surface",
        type=Path,
        metavar="FOLDER",
        help="with --stations: a mesh (OBJ or PLY) per segment (default: the folder that the body file names, else "
        "capsules along the bones)",
    )


def add_start(parser: argparse._ActionsContainer, help_text: str) -> None:
    """Add --start."""
    parser.add_argument("--start", type=Path, metavar="START.YAML", help=f"with --stations: {help_text}")


def given_flags(arguments: argparse.Namespace, *names: str) -> list[str]:
    """Those of some flags that were given, as a user writes them."""
    return [f"--{name.replace('_', '-')}" for name in names if getattr(arguments, name) not in (None, [])]


def check_no_static_flags(arguments: argparse.Namespace, *names: str) -> None:
    """Refuse flags of static cameras where --stations is missing.

    Raises:
        StationError: one of them is given.
    """
    for flag in given_flags(arguments, *names):
        raise StationError(f"{flag} needs --stations, where the static cameras are")


def add_equipment(parser: argparse.ArgumentParser) -> None:
    """Add --equipment."""
    from bodycam_ros.body.equipment_yaml import supplied_equipment

    parser.add_argument(
        "--equipment",
        metavar="NAME_OR_FILE",
        help="what the person rides, holds or stands on: a YAML file, or the name of a supplied one "
        f"({', '.join(supplied_equipment())})",
    )


def add_lenses(parser: argparse.ArgumentParser) -> None:
    """Add --lenses."""
    parser.add_argument(
        "--lenses", type=Path, metavar="DIR", help="folder with each camera's lens YAML (default: beside its video)"
    )


def add_jobs(parser: argparse.ArgumentParser, what: str) -> None:
    """Add --jobs: how many of something work at a time."""
    parser.add_argument("--jobs", type=positive, default=os.cpu_count() or 1, help=f"{what} (default: all cores)")


def positive(text: str) -> int:
    """A whole number from 1; argparse reports any other."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def add_config(parser: argparse.ArgumentParser, *groups: str) -> None:
    """Add --config and, once one of them is used, the flags of settings.

    Args:
        groups: ``module:class`` of settings, imported once a flag is used: those of the pipeline take a second.
    """
    parser.add_argument("--config", type=Path, help="ROS parameter YAML with settings; flags win over it")
    assert isinstance(parser, CommandParser), "commands are added to a CommandParser"
    for group in groups:
        parser.defer(partial(_import_and_add, parser, group))


def _import_and_add(parser: argparse.ArgumentParser, group: str) -> None:
    module, _, name = group.partition(":")
    add_settings_flags(parser, getattr(import_module(f"bodycam_ros.{module}"), name))


def pipeline_settings(arguments: argparse.Namespace) -> "PipelineSettings":
    """Settings of all stages: the defaults, over them the file of --config, over that the flags.

    Raises:
        SettingsError: a value that is unknown or out of range.
    """
    from bodycam_ros.pipeline_settings import PipelineSettings

    return settings_from_flags(arguments, PipelineSettings, arguments.config)


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
    groups = {} if config is None else _read_groups(config, groups_type)
    settings: dict[str, Any] = {}
    for group, settings_type in groups_type.groups().items():
        values = groups.get(group, {})
        # On its own, or a message would name the flag for a fault of the file.
        settings_from_mapping(settings_type, values, f"{config}: {group}")
        flags = {
            description.name: given
            for description in describe(settings_type)
            if (given := getattr(arguments, f"{group}.{description.name}", None)) is not None
        }
        settings[group] = settings_from_mapping(settings_type, values | flags, f"--{group}")
    return groups_type(**settings)


def _read_groups(config: Path, groups_type: type[SettingsGroups]) -> dict[str, dict[str, Any]]:
    """Groups of a parameter file, which one file may hold for every command: each takes its own.

    Raises:
        SettingsError: a group that no command has.
    """
    groups = read_settings_file(config)
    if groups.keys() - groups_type.groups().keys():
        from bodycam_ros.all_settings import all_groups

        known = all_groups() | groups_type.groups()
        for group in groups:
            if group not in known:
                alike = get_close_matches(group, known, n=1)
                meant = f"; is '{alike[0]}' meant?" if alike else f"; known are {', '.join(sorted(known))}"
                raise SettingsError(f"{config}: there is no group {shown(group)}{meant}")
    return groups


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
