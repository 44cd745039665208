"""Flags of the commands that run the pipeline over a recording: its input, and the settings of all stages."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.settings_flags import offer_settings, settings_from_flags

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
