"""bodycam replay: a recorded bag in, a bag with joint states out; exit code 3 where the result should not be used."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from bodycam_ros.body.equipment_yaml import equipment_path, supplied_equipment
from bodycam_ros.cli.settings_flags import add_imu_flag, add_pipeline_flags, pipeline_settings, positive
from bodycam_ros.errors import StationError
from bodycam_ros.output_place import check_output
from bodycam_ros.terminal import Terminal, widened

if TYPE_CHECKING:
    from bodycam_ros.offline.replay_summary import ReplaySummary
    from bodycam_ros.static_cameras.start_file import OutsideInput


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("replay", description=__doc__)
    add_pipeline_flags(parser, map_is_optional=True)
    add_imu_flag(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="ros2 bag folder to write")
    parser.add_argument(
        "--equipment",
        metavar="NAME_OR_FILE",
        help="what the person rides, holds or stands on: a YAML file that says where, or the name of a supplied one "
        f"({', '.join(supplied_equipment())})",
    )
    parser.add_argument(
        "--stations",
        type=Path,
        metavar="CAMERAS.YAML",
        help="where static cameras of the same bag stand, as 'bodycam stations' writes it; without --map its own frame "
        "is the world, and worn cameras are left out",
    )
    parser.add_argument(
        "--surface",
        type=Path,
        metavar="FOLDER",
        help="with --stations: a mesh a segment (OBJ or PLY) that static cameras look for (default: the folder that "
        "the body file names, else capsules along the bones)",
    )
    parser.add_argument(
        "--start",
        type=Path,
        metavar="START.YAML",
        help="with --stations: where the segments are in the first image, placed by hand; worn cameras tell it as well",
    )
    parser.add_argument(
        "--passes",
        type=positive,
        default=1,
        metavar="N",
        help="passes over the recording: all but the last register its cameras and add the landmarks that they see to "
        "a copy of the map (default: 1; 3 where the map shows a part of the place)",
    )
    parser.add_argument(
        "--slim",
        action="store_true",
        help="leave tracks and landmarks out of OUT, three quarters of it; nobody can see afterwards how well they fit",
    )
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there already")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # What solves takes a second to load; --help does without.
    from bodycam_ros.cli.lines import shown_steps
    from bodycam_ros.cli.tables import exit_code
    from bodycam_ros.lens.recorded_lens import other_lenses
    from bodycam_ros.offline.measure_body import doubted_cameras
    from bodycam_ros.offline.replay import replay
    from bodycam_ros.recording.bag_reader import open_recording
    from bodycam_ros.recording.bag_writer import check_replaceable

    console = Terminal(stderr=True)
    settings = pipeline_settings(arguments)
    equipment = None if arguments.equipment is None else equipment_path(arguments.equipment)
    outside = _outside(arguments)
    inputs = (arguments.recording, arguments.map, arguments.body, arguments.config, equipment, *arguments.imu)
    check_output(arguments.output, (*inputs, arguments.stations, arguments.surface, arguments.start))
    if arguments.output.exists():
        check_replaceable(arguments.force, arguments.output)
    with open_recording(arguments.recording) as recording:
        duration_s = recording.duration_s
    columns = (TextColumn("{task.description}"), BarColumn(), _RecordedTime(), _RealTimeFactor(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("replay", total=duration_s, start=False, visible=False, recorded=True)

        def on_progress(seconds: float) -> None:
            if not progress.tasks[task].started:
                progress.start_task(task)
            progress.update(task, completed=seconds, visible=True)

        summary = replay(
            arguments.recording,
            arguments.map,
            arguments.body,
            arguments.output,
            settings,
            jobs=arguments.jobs,
            passes=arguments.passes,
            force=arguments.force,
            on_step=shown_steps(progress),
            on_progress=on_progress,
            equipment=equipment,
            outside=outside,
            slim=arguments.slim,
            imu_paths=arguments.imu,
        )
    lenses = other_lenses(arguments.recording, doubted_cameras(summary))
    remarks = (*summary.remarks, *(match.text for match in lenses))
    _report(summary, remarks, arguments.output)
    return exit_code(summary.verdict)


def _report(summary: "ReplaySummary", remarks: Sequence[str], output: Path) -> None:
    from bodycam_ros.cli.lines import print_clocks, print_rounds
    from bodycam_ros.cli.tables import equipment_tables, print_verdict
    from bodycam_ros.evaluate.equipment_figures import equipment_figures

    if summary.rounds:
        print_rounds(summary.rounds)
    Terminal().print(_table(summary))
    if summary.equipment is not None:
        wide = widened(Terminal())
        for table in equipment_tables(equipment_figures(summary.equipment, summary.start_ns)):
            wide.print(table)
    for remark in remarks:
        Terminal().print(remark, style="red", soft_wrap=True)
    print_clocks(Terminal(), summary.timings, summary.jumps, summary.speeds)
    for camera, count in summary.refused.most_common():
        Terminal().print(f"camera {camera}: not believed at {count} instants, where the others contradict it")
    share = summary.solved / summary.instants if summary.instants else 0.0
    Terminal().print(
        f"{summary.solved} of {summary.instants} instants solved ({share:.1%}), {summary.predicted} of them without "
        f"any camera ({summary.bridged} without any image); {summary.recorded_s:.1f} s in {summary.elapsed_s:.1f} s, "
        f"{summary.real_time_factor:.2f} of real time; written to {output}",
        soft_wrap=True,
    )
    print_verdict(Terminal(), summary.verdict)


def _outside(arguments: argparse.Namespace) -> "OutsideInput | None":
    """What is said of static cameras.

    Raises:
        StationError: it is said for none, nothing tells where the world is, or no map is there to grow in passes.
    """
    from bodycam_ros.static_cameras.start_file import OutsideInput

    if arguments.map is None and arguments.passes > 1:
        raise StationError("--passes lets a reference map grow before the last pass: say which with --map")
    if arguments.stations is not None:
        return OutsideInput(arguments.stations, arguments.surface, arguments.start)
    for flag in ("surface", "start"):
        if getattr(arguments, flag) is not None:
            raise StationError(f"--{flag} is for static cameras: say with --stations where they stand")
    if arguments.map is None:
        raise StationError(
            "nothing tells where the cameras are: give the place's reference map with --map, or static cameras with "
            "--stations"
        )
    return None


def _table(summary: "ReplaySummary") -> Table:
    from bodycam_ros.cli.tables import camera_styles

    table = Table(
        "camera",
        "images",
        "registered",
        "skipped",
        "lost",
        "read-out [ms]",
        caption="registered: knew where the camera was in the map; lost: the recording should hold them; read-out: of "
        "the rows, 0 where all are exposed together",
    )
    styles = camera_styles(summary.verdict)
    for camera, images in sorted((summary.images + summary.lost).items()):
        registered = f"{summary.registered[camera] / images:.1%}"
        skipped, lost = (str(counts[camera] or "") for counts in (summary.skipped, summary.lost))
        readout = summary.readouts[camera].milliseconds if camera in summary.readouts else ""
        table.add_row(camera, str(images), registered, skipped, lost, readout, style=styles.get(camera))
    return table


class _RecordedTime(ProgressColumn):
    def render(self, task: Task) -> Text:
        if not task.fields.get("recorded"):
            return Text(f"{task.percentage:.0f} %")
        return Text(f"{task.completed:.1f} of {task.total or 0:.1f} s recorded")


class _RealTimeFactor(ProgressColumn):
    def render(self, task: Task) -> Text:
        factor = task.completed / task.elapsed if task.elapsed else 0.0
        return Text(f"{factor:.2f} x real time" if task.fields.get("recorded") else "")
