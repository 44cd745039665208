"""bodycam settings: every setting of every stage as a ROS parameter file, with unit, range and reason."""

import argparse
import textwrap
from collections.abc import Iterator

import yaml

from bodycam_ros.settings import describe

_WIDTH = 120
_TITLE = """\
# All settings of all stages with their defaults, as 'bodycam settings' prints them. The same file serves every node
# (--ros-args --params-file FILE) and --config of every command; what a file leaves out keeps its default.
# A running node accepts a new value of a setting marked 'live' (ros2 param set); it reads the others when it is
# configured.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    print(all_settings_yaml(), end="")
    return 0


def all_groups() -> dict[str, type]:
    """Name of a group in a file -> its dataclass: one file serves all commands and nodes, each reads its own of it."""
    from bodycam_ros.body.body_shape import MeasureSettings
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.pipeline.settings import PipelineSettings
    from bodycam_ros.static_cameras.static_camera_registration import StaticCamerasSettings

    every = (PipelineSettings, MapSettings, MeasureSettings, StaticCamerasSettings)
    return {name: group for settings in every for name, group in settings.groups().items()}


def all_settings_yaml() -> str:
    """A ROS parameter file with the default of every setting."""
    lines = ["/**:", "  ros__parameters:"]
    for group, settings_type in all_groups().items():
        lines += ["", *_comment((settings_type.__doc__ or "").splitlines()[0], 4), f"    {group}:"]
        for description in describe(settings_type):
            live = ", live" if description.is_live else ""
            lines += [
                *_comment(description.text() + live, 6),
                f"      {description.name}: {_scalar(description.default)}",
            ]
    return _TITLE + "\n".join(lines) + "\n"


def _comment(text: str, indent: int) -> Iterator[str]:
    for line in textwrap.wrap(text, _WIDTH - indent - 2):
        yield " " * indent + f"# {line}"


def _scalar(value: object) -> str:
    text: str = yaml.safe_dump(value)
    return text.removesuffix("...\n").strip()
