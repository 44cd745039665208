"""bodycam ingest: make one bag from the videos of all cameras, and a report on their clocks."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.options import add_option, add_output, add_span, given_span, input_paths, number
from bodycam_ros.cli.output import print_sections, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import OutputError
from bodycam_ros.evaluate.sections import Section, column_table
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.files.output_place import check_output
from bodycam_ros.results.verdict import WRONG_RESULT

if TYPE_CHECKING:
    from bodycam_ros.ingest.camera_offsets import Offsets
    from bodycam_ros.ingest.ingest import IngestSummary
    from bodycam_ros.ingest.ingest_camera import IngestCamera

EPILOG = (
    "Exit code: 0 if all cameras are in the bag, 3 if a camera is left out (it is named), 1 if a file cannot be used."
)

_CLOCKS = (
    ("by", "by", ""), ("start [s]", "time.start_s", "+.4f"), ("sigma [ms]", "time.start_sigma_s", ".1f", 1e3),
    ("drift [ppm]", "drift", "+.1f", 1e6), ("sigma [ppm]", "drift_sigma", ".1f", 1e6),
    ("confidence", "time.confidence", ".2f"),
)  # fmt: skip
_CLOCKS_NOTE = (
    "start: start of the file in the recording's time; sigma: standard deviation of the time of its images, as the "
    "first image is exposed up to one frame after the sound begins ('bodycam body' and 'bodycam replay' estimate the "
    "rest from the motion); confidence: how much better this start fits than the second best one"
)
_KNOWN_DRIFT = 50e-6  # sigma; cameras that run for seconds tell no drift, and what is printed would be chance
_WRITTEN = (
    ("frames", "frames", "d"), ("per second", "rate_hz", ".2f"), ("size", "size", ""),
    ("read-out [ms]", "readout_s", ".1f", 1e3), ("imu [Hz]", "imu_hz", ".0f"),
    ("in the bag", "encoding", ""),
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "videos",
        type=Path,
        nargs="+",
        metavar="FILES_OR_FOLDER",
        help="a video per camera, named after it (chapters of a camera are joined), or folders with videos or images",
    )
    add_output(
        parser,
        "BAG",
        "ros2 bag folder to write, and beside it BAG_timing with a table of the clocks",
        "BAG, if an ingest wrote it, and its report",
    )
    add_option(parser, "--lenses")
    add_option(parser, "--rig", help="rig YAML: which cameras there should be, and on which segments")
    add_span(parser)
    times = parser.add_mutually_exclusive_group()
    times.add_argument(
        "--synchronous", action="store_true", help="cameras are genlocked: all files start with the same frame"
    )
    times.add_argument(
        "--offsets", type=Path, metavar="YAML", help="start of each camera [s], as 'camera: 1.25' or a timing.yaml"
    )
    add_option(parser, "--rate")
    parser.add_argument(
        "--scale",
        type=number(float, 0.05, 1.0),
        default=1.0,
        help="reduce frames to this share of their size, lenses too (%(default)s)",
    )
    parser.add_argument(
        "--check-lenses",
        action="store_true",
        help="compare each lens with the motion in its images; this takes longer than all other steps together (replay "
        "does it for cameras that fit badly)",
    )
    add_option(parser, "--jobs", help="threads (default: all cores)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.calibration.rig import Rig
    from bodycam_ros.ingest.camera_offsets import find_offsets
    from bodycam_ros.ingest.camera_remarks import left_out_lines, remark_lines
    from bodycam_ros.ingest.ingest import ingest, lens_remarks
    from bodycam_ros.ingest.ingest_camera import find_cameras
    from bodycam_ros.ingest.timing_file import read_offsets, synchronous_offsets, write_timing_report

    report: Path = arguments.output.with_name(f"{arguments.output.name}_timing")
    _check_outputs(arguments, report)
    span = given_span(arguments)
    rig = None if arguments.rig is None else Rig.from_yaml(arguments.rig)
    cameras, refused = find_cameras(arguments.videos, arguments.lenses, arguments.rate, arguments.scale)
    present = {*refused, *(camera.topic_name for camera in cameras)}
    missing = [] if rig is None else rig.missing_cameras(present)
    strange = [] if rig is None else rig.strange_cameras(present)
    with shown_progress() as progress:
        if arguments.synchronous:
            offsets = synchronous_offsets([camera.name for camera in cameras])
        elif arguments.offsets is not None:
            offsets = read_offsets(arguments.offsets, [camera.name for camera in cameras])
        else:
            offsets = find_offsets(cameras, rig, progress)
        summary = ingest(cameras, offsets, arguments.output, arguments.jobs, arguments.force, progress, span)
        write_timing_report(offsets, report)
        lenses = lens_remarks(cameras, progress) if arguments.check_lenses else []
    missing = [*left_out_lines(refused), *missing, *left_out_lines({**offsets.unplaced, **summary.left_out})]
    console = Terminal()
    print_sections(console, _tables(summary, offsets))
    for fault in merge_lines(missing):
        console.print(f"WARNING: {fault}", style="bold red")
    of_streams = [line for stream in summary.streams for line in stream.remark_lines()]
    for remark in merge_lines([*strange, *lenses, *remark_lines(offsets.remarks), *of_streams]):
        console.print(remark, style="red")
    frames = sum(stream.frames for stream in summary.streams)
    console.print(
        f"{len(summary.streams)} cameras, {frames} frames, {summary.duration_s:.1f} s; time 0 is "
        f"{summary.base:%Y-%m-%d %H:%M:%S} UTC; written to {arguments.output}, the clocks to {report}"
    )
    return WRONG_RESULT if missing else 0


def _check_outputs(arguments: argparse.Namespace, report: Path) -> None:
    """Refuse what cannot be written, or must not be replaced, before the work."""
    from bodycam_ros.recording.bag_writer import INGEST, check_replaceable

    inputs = input_paths(arguments)
    check_output(arguments.output, inputs)
    if arguments.output.exists():
        check_replaceable(arguments.force, arguments.output, INGEST)
    check_output(report, (*inputs, arguments.output))
    if report.exists() and not (report.is_dir() and arguments.force):
        raise OutputError(f"{report}: exists already; choose another BAG, or replace it with --force")


def _tables(summary: "IngestSummary", offsets: "Offsets") -> Iterator[Section]:
    """Clocks, in the order in which the cameras started, and what was written of each camera."""
    times = dict(sorted(offsets.times.items(), key=lambda item: item[1].start_s))
    by = {name: "reference" if name == offsets.reference else time.source for name, time in times.items()}
    clocks: dict[str, object] = {}
    for name, time in times.items():
        is_known = time.drift_sigma < _KNOWN_DRIFT
        drift = {"drift": time.drift, "drift_sigma": time.drift_sigma} if is_known else {}
        clocks[name] = {"time": time, "by": by[name], **drift}
    yield column_table("clocks of the cameras", "camera", _CLOCKS, clocks, _CLOCKS_NOTE)
    written = {}
    for stream in summary.streams:
        source = stream.camera
        seconds = 1e-9 * (stream.last_ns - stream.first_ns)
        written[source.name] = {
            "frames": stream.frames,
            "rate_hz": (stream.frames - 1) / seconds if stream.frames > 1 else 0.0,
            "size": f"{source.written_lens.width} x {source.written_lens.height}",
            "readout_s": source.readout_s,
            "imu_hz": stream.imu_samples / max(1e-9, source.video.facts.duration_s) or None,
            "encoding": _encoding(source),
        }
    flagged = {stream.camera.name for stream in summary.streams if stream.remark_lines()}
    yield column_table("the bag", "camera", _WRITTEN, written, flagged=flagged)


def _encoding(source: "IngestCamera") -> str:
    facts = source.video.facts
    if source.is_copied:
        return facts.codec
    why = [f"at {source.scale:.0%} of its size"] if source.scale != 1.0 else []
    why += [f"turned by {facts.rotation_deg} deg"] if facts.rotation_deg else []
    why += ["it had B-frames"] if facts.has_b_frames else []
    return ", ".join(["h264, encoded again", *why])
