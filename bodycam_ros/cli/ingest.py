"""bodycam ingest: videos of cameras in, one bag out."""

import argparse
import os
from pathlib import Path

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.cli.pipeline_flags import known_groups
from bodycam_ros.cli.settings_flags import add_settings_flags, check_groups, settings_from_flags
from bodycam_ros.ingest.ingest import IngestedCamera, IngestSummary, find_cameras, ingest
from bodycam_ros.ingest.sound_settings import SoundSettings
from bodycam_ros.ingest.timing_picture import PICTURE_NAME, draw_timing
from bodycam_ros.ingest.timing_report import timing_table, write_timing
from bodycam_ros.ingest.video_clocks import video_clocks
from bodycam_ros.output_place import check_output
from bodycam_ros.recording.bag_writer import check_ingested
from bodycam_ros.terminal import Terminal

_ROWS = "rows: how long the camera takes to read them out, where its lens YAML has readout_time"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("ingest", help="make a bag of videos from ordinary cameras", description=__doc__)
    parser.add_argument(
        "videos",
        type=Path,
        nargs="+",
        metavar="FILES_OR_FOLDER",
        help="a video per camera, named after it (chapters of a camera are joined), or folders with them",
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="BAG", help="ros2 bag folder to write")
    parser.add_argument(
        "--cameras",
        type=Path,
        metavar="DIR",
        help="folder with the lens YAML of each camera (default: beside its video)",
    )
    parser.add_argument(
        "--rig", type=Path, help="rig YAML: says which cameras there should be, and whose motions are alike"
    )
    parser.add_argument("--jpeg", action="store_true", help="write a JPEG for each frame, in place of video")
    parser.add_argument("--force", action="store_true", help="replace BAG if an ingest wrote it")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="threads (all cores)")
    parser.add_argument("--config", type=Path, help="ROS parameter YAML with settings; flags win over it")
    add_settings_flags(parser, SoundSettings)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_output(arguments.output, (*arguments.videos, arguments.cameras, arguments.rig, arguments.config))
    if arguments.config is not None:
        check_groups(arguments.config, known_groups())
    settings = settings_from_flags(arguments, SoundSettings, arguments.config)
    if arguments.output.exists():
        check_ingested(arguments.force, arguments.output)
    rig = None if arguments.rig is None else Rig.from_yaml(arguments.rig)
    cameras, faults = find_cameras(arguments.videos, arguments.cameras)
    if rig is not None:
        there = {camera.name for camera in cameras}
        faults += [f"camera {camera}: is in {arguments.rig}, but has no video" for camera in set(rig.cameras) - there]
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("clocks", total=1.0)
        offsets = video_clocks(
            cameras,
            rig,
            settings,
            lambda what, done, of: progress.update(task, description=what, completed=done / max(of, 1)),
        )
        progress.update(task, description="writing", completed=0.0)
        summary = ingest(
            cameras,
            lambda videos: offsets.times,
            arguments.output,
            as_jpeg=arguments.jpeg,
            jobs=max(1, arguments.jobs),
            force=arguments.force,
            on_progress=lambda share: progress.update(task, completed=share),
        )
        write_timing(offsets, arguments.output)
        draw_timing(offsets, arguments.output / PICTURE_NAME)
    console = Terminal()
    console.print(timing_table(offsets))
    console.print(_table(summary))
    remarks = [
        *faults,
        *offsets.remarks,
        *summary.faults,
        *(remark for camera in summary.cameras for remark in camera.remarks),
    ]
    for remark in remarks:
        console.print(remark, style="red", soft_wrap=True)
    frames = sum(camera.stream.tally.frames for camera in summary.cameras)
    console.print(
        f"{len(summary.cameras)} cameras, {frames} frames, {summary.duration_s:.1f} s; time 0 is "
        f"{summary.base:%Y-%m-%d %H:%M:%S} UTC; written to {arguments.output}",
        soft_wrap=True,
    )
    return 0


def _table(summary: IngestSummary) -> Table:
    table = Table(
        Column("camera", no_wrap=True), "frames", "per second", "begins [s]", "clock", "rows [ms]", "in the bag"
    )
    table.caption = _ROWS
    for camera in summary.cameras:
        stream = camera.stream
        readout_s = stream.camera.readout_s
        table.add_row(
            stream.camera.name,
            str(stream.tally.frames),
            f"{_rate_hz(camera):.2f}",
            f"{1e-9 * (stream.tally.first_ns - stream.base_ns):.4f}",
            stream.time.source,
            "" if readout_s is None else f"{1e3 * readout_s:.1f}",
            _how(camera),
            style="red" if camera.remarks else None,
        )
    return table


def _rate_hz(camera: IngestedCamera) -> float:
    tally = camera.stream.tally
    return 1e9 * (tally.frames - 1) / (tally.last_ns - tally.first_ns) if tally.frames > 1 else 0.0


def _how(camera: IngestedCamera) -> str:
    stream, facts = camera.stream, camera.stream.camera.video.facts
    if stream.is_copied:
        return facts.codec
    why = [f"turned by {facts.rotation_deg} deg"] if facts.rotation_deg else []
    if not stream.as_jpeg and facts.has_b_frames:
        why.append("it had B-frames")
    return ", ".join(["jpeg" if stream.as_jpeg else "h264, made anew", *why])
