"""bodycam replay: a recorded bag in, a bag with joint states out; exit code 3 where the result should not be used."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from bodycam_ros.cli.options import (
    PIPELINE,
    add_config,
    add_equipment,
    add_option,
    add_output,
    input_paths,
    number,
    pipeline_settings,
)
from bodycam_ros.cli.output import print_sections, print_verdict, shown_progress
from bodycam_ros.errors import StationError
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.lens.lens_check import find_mismatches
from bodycam_ros.offline.extend import ExtensionRound
from bodycam_ros.offline.replay import replay
from bodycam_ros.offline.replay_summary import ReplaySummary
from bodycam_ros.output_place import check_output
from bodycam_ros.recording.bag_writer import check_replaceable
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.terminal import Terminal

_COLUMNS = (
    ("images", "images", "d"), ("registered", "registered", ".1%"), ("dropped", "dropped", "d"),
    ("missing", "missing", "d"), ("read-out [ms]", "readout", ""),
)  # fmt: skip
_NOTE = (
    "registered: in the map; dropped: could not be used; missing: counted in the recording, but not in it; read-out: "
    "time of all rows, 0 for a global shutter"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_option(parser, "recording")
    add_option(parser, "--map")
    body_help = "body YAML, made by 'bodycam body': segments, joints, camera mounts"
    add_option(parser, "--body", required=True, help=body_help)
    add_output(parser, "OUT", "ros2 bag folder to write")
    add_option(parser, "--imu")
    add_equipment(parser)
    stations_help = (
        "where static cameras of the same bag are, as 'bodycam stations' writes it; without --map its own frame is the "
        "world, and body cameras are left out"
    )
    add_option(parser, "--stations", help=stations_help)
    add_option(parser, "--surface")
    start_help = "with --stations: where the segments are in the first image; body cameras measure it as well"
    add_option(parser, "--start", help=start_help)
    parser.add_argument(
        "--passes",
        type=number(int, 1, 100),
        default=1,
        metavar="N",
        help="passes over the recording: all but the last register its cameras and add the landmarks that they see to "
        "a copy of the map (default: 1; 3 where the map shows a part of the place)",
    )
    parser.add_argument(
        "--slim",
        action="store_true",
        help="leave tracks and landmarks out of OUT, three quarters of it; reprojection errors are then unknown",
    )
    add_option(parser, "--jobs", help="processes for the cameras (default: all cores)")
    add_config(parser, PIPELINE)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    settings = pipeline_settings(arguments)
    outside = _outside(arguments)
    check_output(arguments.output, input_paths(arguments))
    if arguments.output.exists():
        check_replaceable(arguments.force, arguments.output)
    with shown_progress() as progress:
        summary = replay(
            arguments.recording,
            arguments.map,
            arguments.body,
            arguments.output,
            settings,
            jobs=arguments.jobs,
            passes=arguments.passes,
            force=arguments.force,
            on_step=progress.show,
            equipment=arguments.equipment,
            outside=outside,
            slim=arguments.slim,
            imu_paths=arguments.imu,
        )
    return _print(summary, arguments.recording, arguments.output)


def _outside(arguments: argparse.Namespace) -> StaticCameraFiles | None:
    """Files of static cameras; None without them.

    Raises:
        StationError: an option is given without static cameras, or the world or the map of --passes is missing.
    """
    if arguments.map is None and arguments.passes > 1:
        raise StationError("--passes extends a reference map before the last pass: give it with --map")
    if arguments.stations is not None:
        return StaticCameraFiles(arguments.stations, arguments.surface, arguments.start)
    if arguments.map is None:
        raise StationError("give the place's reference map with --map, or static cameras with --stations")
    return None


def _print(summary: ReplaySummary, recording: Path, output: Path) -> int:
    """Print the summary; the exit code."""
    from bodycam_ros.offline.replay_remarks import clock_remarks
    from bodycam_ros.terminal import Terminal

    terminal = Terminal()
    if summary.rounds:
        print_rounds(summary.rounds)
    rows = {
        camera: {
            "images": images,
            "registered": summary.registered[camera] / images,
            "dropped": summary.skipped[camera] or None,
            "missing": summary.lost[camera] or None,
            "readout": summary.readouts[camera].milliseconds if camera in summary.readouts else None,
        }
        for camera, images in sorted((summary.images + summary.lost).items())
    }
    faulty = {finding.subject for finding in summary.verdict.findings}
    print_sections(terminal, [column_table("cameras", "camera", _COLUMNS, rows, _NOTE, faulty)])
    if summary.equipment is not None:
        from bodycam_ros.evaluate.equipment import equipment_figures
        from bodycam_ros.evaluate.report_sections import equipment_sections

        print_sections(terminal, equipment_sections(equipment_figures(summary.equipment, summary.start_ns)))
    mismatches = find_mismatches(recording, summary.doubted_cameras) if summary.doubted_cameras else ()
    for remark in (*summary.remarks, *(match.text for match in mismatches)):
        terminal.print(remark, style="red")
    for line in clock_remarks(summary.timings, summary.speeds):
        terminal.print(line)
    for camera, count in summary.rejected.most_common():
        terminal.print(f"camera {camera}: rejected at {count} frames, where the others contradict it")
    share = summary.solved / summary.instants if summary.instants else 0.0
    terminal.print(
        f"{summary.solved} of {summary.instants} frames solved ({share:.1%}), {summary.predicted} of them without "
        f"any camera ({summary.interpolated} without any image); {summary.recorded_s:.1f} s in "
        f"{summary.elapsed_s:.1f} s, {summary.real_time_factor:.2f} of real time; written to {output}"
    )
    return print_verdict(terminal, summary.verdict)


def print_rounds(rounds: Sequence[ExtensionRound]) -> None:
    """Print the share of registered images per camera and round of map extension."""
    columns = [(f"round {count}", str(count), ".1%") for count in range(1, len(rounds) + 1)]
    rows = {
        camera: {str(n): one.shares[camera] for n, one in enumerate(rounds, 1)} for camera in sorted(rounds[0].shares)
    }
    rows["all"] = {str(n): one.share for n, one in enumerate(rounds, 1)}
    terminal = Terminal()
    print_sections(terminal, [column_table("registered images", "camera", columns, rows)])
    terminal.print(f"{rounds[0].absolute:.1%} of all images are registered by landmarks of the photographs")
