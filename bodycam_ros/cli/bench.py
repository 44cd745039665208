"""bodycam bench: what each stage costs on this machine, and how the whole compares with real time."""

import argparse
import tempfile
from pathlib import Path

from rich.progress import Progress
from rich.table import Table

from bodycam_ros.cli.pipeline_flags import add_pipeline_flags, pipeline_settings
from bodycam_ros.evaluate.stage_timing import StageTiming, time_stages
from bodycam_ros.replay.replay import replay
from bodycam_ros.terminal import Terminal
from bodycam_ros.whole_file import scratch_folder

_DESIGN_SOLVE_MS = 8.0
"""What the design measured for 13 segments and 16 cameras on one core of its machine."""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("bench", help="time every stage on a recording", description=__doc__)
    add_pipeline_flags(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    settings = pipeline_settings(arguments)
    inputs = (arguments.recording, arguments.map, arguments.body)
    with Progress(console=Terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("stages, one thread", total=None)
        timing = time_stages(*inputs, settings, on_image=lambda: progress.advance(task))
        progress.update(task, description="replay, all cores")
        with scratch_folder(Path(tempfile.gettempdir())) as scratch:
            summary = replay(*inputs, scratch / "out", settings, jobs=arguments.jobs)
    console = Terminal()
    console.print(_table(timing))
    console.print(
        f"tracker: {timing.tracker_ratio:.2f} times the OpenCV calls that it needs\n"
        f"solver: {timing.solve_ms:.1f} ms per instant, {timing.solve_ms / _DESIGN_SOLVE_MS:.2f} times the design's "
        f"{_DESIGN_SOLVE_MS:g} ms\n"
        f"replay: {summary.recorded_s:.1f} s of {len(summary.images)} cameras in {summary.elapsed_s:.1f} s with "
        f"{arguments.jobs} processes, {summary.real_time_factor:.2f} of real time",
        soft_wrap=True,
    )
    return 0


def _table(timing: StageTiming) -> Table:
    table = Table("stage", "ms per image", "ms per call", "calls")
    for stage, seconds in timing.seconds.items():
        calls = timing.keyframes if stage == "describe" else timing.images
        per_image, per_call = 1e3 * seconds / max(timing.images, 1), 1e3 * seconds / max(calls, 1)
        table.add_row(stage, f"{per_image:.2f}", f"{per_call:.2f}", str(calls))
    cameras = timing.images / max(timing.instants, 1)
    table.add_row("solve", f"{timing.solve_ms / max(cameras, 1):.2f}", f"{timing.solve_ms:.2f}", str(timing.instants))
    return table
