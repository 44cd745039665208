"""bodycam bench: what each stage costs on this machine, and how the whole compares with real time."""

import argparse
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import Progress
from rich.table import Table

from bodycam_ros.cli.pipeline_flags import add_pipeline_flags, pipeline_settings
from bodycam_ros.terminal import Terminal
from bodycam_ros.whole_file import scratch_folder

if TYPE_CHECKING:
    from bodycam_ros.evaluate.endurance import Endurance
    from bodycam_ros.evaluate.map_size_timing import MapSizeTiming
    from bodycam_ros.evaluate.stage_timing import StageTiming
    from bodycam_ros.pipeline import PipelineSettings

_DESIGN_SOLVE_MS = 8.0
"""What the design measured for 13 segments and 16 cameras on one core of its machine."""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("bench", description=__doc__)
    add_pipeline_flags(parser)
    parser.add_argument(
        "--minutes",
        type=float,
        default=0.0,
        help="also solve the recording to and fro for so long, and say whether time and memory stay the same",
    )
    parser.add_argument(
        "--solver",
        action="store_true",
        help="instead of all that, solve the recording's registrations in several ways and compare them: alone, in a "
        "window, as a whole, and all of it once more with a quarter of the cameras dark in turn",
    )
    parser.add_argument("--truth", type=Path, help="with --solver: the recording's folder with its ground truth")
    parser.add_argument("--picture", type=Path, help="with --solver and --truth: PNG to draw of it")
    parser.add_argument("--force", action="store_true", help="with --picture: replace it if it is there already")
    parser.set_defaults(run=partial(run, parser))


def run(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.body.body_file import read_body
    from bodycam_ros.cli.bench_solver import bench_solver
    from bodycam_ros.evaluate.map_size_timing import time_map_sizes
    from bodycam_ros.evaluate.stage_timing import time_stages
    from bodycam_ros.evaluate.station_timing import time_stations
    from bodycam_ros.replay.replay import replay

    _check_flags(parser, arguments)
    settings = pipeline_settings(arguments)
    if arguments.solver:
        return bench_solver(arguments, settings)
    inputs = (arguments.recording, arguments.map, arguments.body)
    with Progress(console=Terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("stages, one thread", total=None)
        timing = time_stages(*inputs, settings, on_image=lambda: progress.advance(task))
        progress.update(task, description="maps of other sizes")
        sizes = time_map_sizes(*inputs[:2], timing.registered, settings, on_map=lambda: progress.advance(task))
        progress.update(task, description="static cameras")
        outside = time_stations(read_body(arguments.body), settings)
        progress.update(task, description="replay, all cores")
        with scratch_folder(Path(tempfile.gettempdir())) as scratch:
            summary = replay(*inputs, scratch / "out", settings, jobs=arguments.jobs)
        endurance = _endurance(arguments, timing, settings, progress) if arguments.minutes > 0.0 else None
    console = Terminal()
    console.print(_table(timing))
    console.print(_size_table(sizes))
    console.print(
        f"tracker: {timing.tracker_ratio:.2f} times the OpenCV calls that flow and descriptors alone would need\n"
        f"solver: {timing.solve_ms:.1f} ms per instant, {timing.solve_ms / _DESIGN_SOLVE_MS:.2f} times the design's "
        f"{_DESIGN_SOLVE_MS:g} ms\n"
        f"replay: {summary.recorded_s:.1f} s of {len(summary.images)} cameras in {summary.elapsed_s:.1f} s with "
        f"{arguments.jobs} processes, {summary.real_time_factor:.2f} of real time",
        soft_wrap=True,
    )
    if outside:
        console.print(
            f"static cameras: {outside.median_ms:.1f} ms per instant of {outside.stations} cameras and "
            f"{outside.segments} segments of {outside.faces:,} faces in all, {outside.share_ms:.2f} ms per segment and "
            "camera, images decoded; on a scene of its own",
            soft_wrap=True,
        )
    if endurance:
        console.print(
            f"solver over {arguments.minutes:g} min: {endurance.percentile_ms(50):.1f} ms per instant (median), "
            f"{endurance.percentile_ms(99):.1f} (p99), {endurance.percentile_ms(100):.0f} (worst); mean of the last "
            f"minute {endurance.last_minute_ms:.2f} ms, {endurance.last_minute_ms / endurance.first_minute_ms:.2f} "
            f"times the first; {endurance.growth_mb:+.1f} MB since the first minute",
            soft_wrap=True,
        )
    return 0


def _check_flags(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Refuse flags that would be passed over."""
    for flag, given, needs, there in (
        ("--truth", arguments.truth, "--solver", arguments.solver),
        ("--picture", arguments.picture, "--solver", arguments.solver),
        ("--picture", arguments.picture, "--truth", arguments.truth),
        ("--force", arguments.force, "--picture", arguments.picture),
    ):
        if given and not there:
            parser.error(f"{flag} needs {needs}")
    if arguments.solver and arguments.minutes > 0.0:
        parser.error("--minutes is not for --solver, which solves the recording as it is; leave out one of them")


def _endurance(
    arguments: argparse.Namespace, timing: "StageTiming", settings: "PipelineSettings", progress: Progress
) -> "Endurance":
    from bodycam_ros.body.body_file import read_body
    from bodycam_ros.evaluate.endurance import endure
    from bodycam_ros.recording.bag_reader import open_recording

    task = progress.add_task(f"solver, {arguments.minutes:g} min", total=None)
    with open_recording(arguments.recording) as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras}
    return endure(
        read_body(arguments.body),
        cameras,
        timing.registered,
        settings,
        60.0 * arguments.minutes,
        on_instant=lambda: progress.advance(task),
    )


def _table(timing: "StageTiming") -> Table:
    table = Table("stage", "ms per image", "ms per call", "calls")
    for stage, seconds in timing.seconds.items():
        calls = timing.keyframes if stage == "describe" else timing.images
        per_image, per_call = 1e3 * seconds / max(timing.images, 1), 1e3 * seconds / max(calls, 1)
        table.add_row(stage, f"{per_image:.2f}", f"{per_call:.2f}", str(calls))
    cameras = timing.images / max(timing.instants, 1)
    table.add_row("solve", f"{timing.solve_ms / max(cameras, 1):.2f}", f"{timing.solve_ms:.2f}", str(timing.instants))
    return table


def _size_table(sizes: "list[MapSizeTiming]") -> Table:
    table = Table("landmarks of a map", *(f"{size.landmarks:,}" for size in sizes), title="ms per image, lost or not")
    rows = {
        "found by photographs": [f"{size.direct_ms:.2f}" if size.direct_ms is not None else "-" for size in sizes],
        "keyframe named": [f"{size.named_ms:.1f}" for size in sizes],
        "lost: where the body has it": [f"{size.expected_ms:.1f}" for size in sizes],
        "lost: in similar photographs": [f"{size.similar_ms:.1f}" for size in sizes],
        "lost: anywhere": [f"{size.anywhere_ms:.1f}" for size in sizes],
        "to be ready for these, once [s]": [f"{size.prepared_s:.2f}" for size in sizes],
        "memory [MB]": [f"{size.memory_mb:,.0f}" for size in sizes],
    }
    for name, values in rows.items():
        table.add_row(name, *values)
    return table
