"""Options that several commands share, and the settings of a command."""

import argparse
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, TypeVar

from bodycam_ros.cli.command_parser import CommandParser
from bodycam_ros.errors import SettingsError
from bodycam_ros.files.output_place import check_file, check_output
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.settings import SettingsGroups, read_settings_file, settings_from_mapping

if TYPE_CHECKING:
    from bodycam_ros.pipeline.settings import PipelineSettings
    from bodycam_ros.recording.time_span import TimeSpan
    from bodycam_ros.recording.topic_names import TopicNames

G = TypeVar("G", bound=SettingsGroups)
N = TypeVar("N", int, float)

PIPELINE = "pipeline.settings:PipelineSettings"
"""Settings of all stages, for ``add_config``."""


def number(kind: Callable[[str], N], low: float, high: float, unit: str = "") -> Callable[[str], N]:
    """Converter of a number from ``low`` to ``high``, with or without its unit; argparse reports any other."""

    def convert(text: str) -> N:
        try:
            value = kind(text.removesuffix(unit))
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            what = "a whole number" if kind is int else "a number"
            limits = f"{low:g} to {high:g} {unit}".rstrip()
            raise argparse.ArgumentTypeError(f"expected {what} from {limits}, not {text!r}")
        return value

    return convert


def time_span(text: str) -> tuple[float, float]:
    """Converter of two times of a recording, FROM:TO [s]; argparse reports anything else."""
    start, colon, end = text.partition(":")
    try:
        span = float(start), float(end)
    except ValueError:
        span = (0.0, 0.0)
    if not colon or not 0.0 <= span[0] < span[1] < math.inf:
        raise argparse.ArgumentTypeError(f"expected two times in seconds, as 12.5:15, not {text!r}")
    return span


TRAVEL: Mapping[str, Any] = {"type": number(float, 0.0, 60.0, "m/s"), "metavar": "M/S"}
"""A speed that is added to a motion, as of argparse."""

_OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "recording": {"metavar": "BAG", "help": "ros2 bag folder or .mcap file with the cameras"},
    "--map": {"help": "reference map, a folder made by 'bodycam map'"},
    "--rig": {"help": "YAML: camera -> segment that it is strapped to, segment -> parent"},
    "--imu": {
        "action": "append", "default": [], "metavar": "BAG",
        "help": "bag with /<camera>/imu of the same recording, where BAG itself has none; may be given several times",
    },
    "--stations": {"metavar": "CAMERAS.YAML"},
    "--surface": {
        "metavar": "FOLDER", "needs": "stations",
        "help": "with --stations: a mesh (OBJ or PLY) per segment (default: the folder that the body file names, else "
        "capsules along the bones)",
    },
    "--start": {"metavar": "START", "needs": "stations"},
    "--keypoints": {
        "metavar": "KEYPOINTS", "needs": "stations",
        "help": "with --stations: 2-D keypoints that count beside the contours: a folder of each camera's, a JSON file "
        "for each image; auto, which detects them in all images; or none (default: auto with --start auto, else none); "
        "the start as well where --start is not given",
    },
    "--person": {
        "type": number(int, 1, 20), "metavar": "N", "needs": "start",
        "help": "with --start auto, or a folder of keypoints: which of the people it is; 1 is the one on whom the most "
        "keypoints of all cameras agree (default: 1)",
    },
    "--height": {"type": float, "metavar": "METRES"},
    "--lenses": {
        "metavar": "DIR_OR_FILE",
        "help": "folder with a lens YAML for each camera (default: beside its video), or a file of static cameras with "
        "their lenses (from 'bodycam stations', a TOML or a .qca.txt)",
    },
    "--rate": {
        "type": number(float, 1e-3, 1000.0, "Hz"),
        "metavar": "HZ",
        "help": "images per second of folders with images, if their names are not stamps",
    },
    "--jobs": {"type": number(int, 1, 1000), "default": os.cpu_count() or 1},
}  # fmt: skip
"""Options that several commands have; they are paths where no other type is given."""


def add_option(parser: argparse._ActionsContainer, name: str, **changes: Any) -> None:
    """Add an option of ``_OPTIONS``, or another path.

    Args:
        parser: or a group of it.
        name: of the option.
        changes: as of argparse; and ``needs``: name of an argument without which this one is refused.
    """
    options = {"type": Path, **_OPTIONS.get(name, {}), **changes}
    needed = options.pop("needs", None)
    parser.add_argument(name, **options).needs = needed  # type: ignore[attr-defined]  # CommandParser reads it


def add_output(parser: argparse.ArgumentParser, metavar: str, help_text: str, replaced: str | None = None) -> None:
    """Add -o and --force.

    Args:
        replaced: what --force replaces, if not just the output.
    """
    parser.add_argument("-o", "--output", type=Path, required=True, metavar=metavar, help=help_text)
    parser.add_argument("--force", action="store_true", help=f"replace {replaced or metavar}, if already there")


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add --prefix and --topics."""
    prefix_help = "namespace of the cameras to read, such as /anna of /anna/head/image_raw (default: none)"
    parser.add_argument("--prefix", default="", metavar="NAMESPACE", help=prefix_help)
    parser.add_argument(
        "--topics",
        nargs="+",
        default=[],
        metavar="CAMERA=TOPIC",
        help="topics that are not named /CAMERA/image_raw: images of a camera, with camera_info beside them, as "
        "waist_front=/cam0/color/image_raw; inertial sensor of a camera, as waist_front/imu=/cam0/imu",
    )


def topic_names(arguments: argparse.Namespace) -> "TopicNames":
    """Names of the topics of a recording.

    Raises:
        RecordingError: --topics is malformed.
    """
    from bodycam_ros.recording.topic_names import TopicNames

    return TopicNames.parse(arguments.prefix, arguments.topics)


def add_span(parser: argparse.ArgumentParser, *to_flags: str) -> None:
    """Add --from and --to, times of a recording; ``to_flags``: other names of the latter."""
    unit = "in seconds since the first image of the recording, as reports print it"
    seconds = number(float, 0.0, 1e7, "s")
    parser.add_argument("--from", dest="from_s", type=seconds, metavar="S", help=f"start of the part to use, {unit}")
    to_flags = to_flags or ("--to", "--until")
    parser.add_argument(
        *to_flags, dest="to_s", type=seconds, metavar="S", help="end of the part to use, in the same seconds"
    )


def given_span(arguments: argparse.Namespace) -> "TimeSpan":
    """The part of the recording that is asked for.

    Raises:
        SettingsError: it ends before it begins.
    """
    from bodycam_ros.recording.time_span import TimeSpan

    span = TimeSpan(
        0.0 if arguments.from_s is None else arguments.from_s, math.inf if arguments.to_s is None else arguments.to_s
    )
    if span.from_s >= span.to_s:
        raise SettingsError(f"the part {span.text} is empty; give --from a time before the end")
    return span


def given_flags(arguments: argparse.Namespace, *names: str) -> list[str]:
    """The flags that were given, as a user writes them."""
    return [f"--{name.replace('_', '-')}" for name in names if getattr(arguments, name) not in (None, [])]


def input_paths(arguments: argparse.Namespace) -> tuple[Path, ...]:
    """All files and folders that a command reads: every path among its arguments but the output."""
    given = (value for name, value in vars(arguments).items() if name != "output")
    lists = (value if isinstance(value, list) else [value] for value in given)
    return tuple(path for paths in lists for path in paths if isinstance(path, Path))


def check_files(arguments: argparse.Namespace, *files: tuple[Path, bytes, str]) -> None:
    """Refuse files that cannot be written, or must not be replaced, before the work.

    Args:
        files: path, mark and kind of each, as of ``check_file``.

    Raises:
        OutputError: one is an input, cannot be written, or is something else.
    """
    for path, mark, what in files:
        check_output(path, input_paths(arguments))
        check_file(path, arguments.force, mark, what)


def add_equipment(parser: argparse.ArgumentParser) -> None:
    """Add --equipment."""
    from bodycam_ros.body.equipment_yaml import equipment_path, supplied_equipment

    parser.add_argument(
        "--equipment",
        type=equipment_path,
        metavar="NAME_OR_FILE",
        help="what the person rides, holds or stands on: a YAML file, or the name of a supplied one "
        f"({', '.join(supplied_equipment())})",
    )


def add_config(parser: argparse.ArgumentParser, *groups: str) -> None:
    """Add --config, and flags ``--group.name VALUE`` of settings.

    Args:
        groups: ``module:class`` of settings, imported if a flag is used.
    """
    flags = "; a flag --GROUP.NAME VALUE overrides a setting" if groups else ""
    help_text = f"ROS parameter YAML with settings, as 'bodycam settings' prints them{flags}"
    parser.add_argument("--config", type=Path, metavar="YAML", help=help_text)
    parser.set_defaults(settings={})
    if groups:
        assert isinstance(parser, CommandParser), "commands are added to a CommandParser"
        parser.read_groups = lambda: {
            name for group in groups for name in resolve_name(f"bodycam_ros.{group}").groups()
        }


def pipeline_settings(arguments: argparse.Namespace) -> "PipelineSettings":
    """Settings of all stages; see ``read_settings``."""
    from bodycam_ros.pipeline.settings import PipelineSettings

    return read_settings(arguments, PipelineSettings)


def read_settings(arguments: argparse.Namespace, groups_type: type[G]) -> G:
    """Settings of some groups: the defaults, over them the file of --config, over that the flags.

    Raises:
        SettingsError: unknown name, wrong type or value out of range, in the file or in a flag.
    """
    config: Path | None = arguments.config
    groups = {} if config is None else _read_groups(config, groups_type)
    settings: dict[str, Any] = {}
    for group, settings_type in groups_type.groups().items():
        values, flags = groups.get(group, {}), arguments.settings.get(group, {})
        # On its own, or a message would name the flag for a fault of the file.
        settings_from_mapping(settings_type, values, f"{config}: {group}")
        settings[group] = settings_from_mapping(settings_type, values | flags, f"--{group}", is_text=True)
    return groups_type(**settings)


def _read_groups(config: Path, groups_type: type[SettingsGroups]) -> dict[str, dict[str, Any]]:
    """Groups of a parameter file, which may have those of every command: each takes its own.

    Raises:
        SettingsError: a group that no command has.
    """
    groups = read_settings_file(config)
    if groups.keys() - groups_type.groups().keys():
        from bodycam_ros.cli.settings import all_groups

        known = all_groups() | groups_type.groups()
        for group in groups:
            if group not in known:
                raise SettingsError(f"{config}: there is no group {shown(group)}; {other_than(group, sorted(known))}")
    return groups
