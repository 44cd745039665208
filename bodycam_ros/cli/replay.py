"""bodycam replay: a recorded bag in, a bag with joint states out."""

import argparse
import os
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from bodycam_ros.cli.settings_flags import add_settings_flags, settings_from_flags
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.replay.replay import ReplaySummary, replay


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("replay", help="solve a recorded bag offline", description=__doc__)
    parser.add_argument("recording", type=Path, metavar="BAG", help="ros2 bag folder or .mcap file with the cameras")
    parser.add_argument("--map", type=Path, required=True, help="reference map, a folder made by 'bodycam map'")
    parser.add_argument("--body", type=Path, required=True, help="body YAML: segments, joints, camera mounts")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="ros2 bag folder to write")
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there already")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes for the cameras (all cores)")
    parser.add_argument("--config", type=Path, help="ROS parameter YAML with settings; flags win over it")
    for group, settings_type in PipelineSettings.groups().items():
        add_settings_flags(parser, group, settings_type)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    console = Console(stderr=True)
    settings = PipelineSettings(
        **{
            group: settings_from_flags(arguments, group, settings_type, arguments.config)
            for group, settings_type in PipelineSettings.groups().items()
        }
    )
    with open_recording(arguments.recording) as recording:
        duration_s = recording.duration_s
    columns = (TextColumn("replay"), BarColumn(), _RecordedTime(), _RealTimeFactor(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("replay", total=duration_s)
        summary = replay(
            arguments.recording,
            arguments.map,
            arguments.body,
            arguments.output,
            settings,
            jobs=max(1, arguments.jobs),
            force=arguments.force,
            on_progress=lambda seconds: progress.update(task, completed=seconds),
        )
    Console().print(_table(summary))
    share = summary.solved / summary.instants if summary.instants else 0.0
    Console().print(
        f"{summary.solved} of {summary.instants} instants solved ({share:.1%}), {summary.predicted} of them without any "
        f"camera; {summary.recorded_s:.1f} s in {summary.elapsed_s:.1f} s, {summary.real_time_factor:.2f} of real time; "
        f"written to {arguments.output}",
        soft_wrap=True,
    )
    return 0


def _table(summary: ReplaySummary) -> Table:
    table = Table("camera", "images", "registered", "skipped")
    for camera, images in sorted(summary.images.items()):
        registered = f"{summary.registered[camera] / images:.1%}"
        table.add_row(camera, str(images), registered, str(summary.skipped[camera] or ""))
    return table


class _RecordedTime(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(f"{task.completed:.1f} of {task.total or 0:.1f} s recorded")


class _RealTimeFactor(ProgressColumn):
    def render(self, task: Task) -> Text:
        factor = task.completed / task.elapsed if task.elapsed else 0.0
        return Text(f"{factor:.2f} x real time")
