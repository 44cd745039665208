"""bodycam bench --solver: the solver against other ways to solve the same registrations, as a table and a picture."""

import argparse
from collections.abc import Mapping

import numpy as np
from rich.progress import Progress
from rich.table import Table

from bodycam_ros.body.body_file import read_body
from bodycam_ros.evaluate.solver_comparison import MeasuredRun, compare_solvers, registrations
from bodycam_ros.evaluate.solver_picture import draw_solvers
from bodycam_ros.evaluate.solver_runs import Way
from bodycam_ros.evaluate.true_motion import read_true_motion
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.terminal import Terminal, widened
from bodycam_ros.whole_file import whole_file

_PNG = b"\x89PNG"


def bench_solver(arguments: argparse.Namespace, settings: PipelineSettings) -> int:
    """Run the command."""
    if arguments.picture is not None:
        inputs = (arguments.recording, arguments.map, arguments.body, arguments.config, arguments.truth)
        check_output(arguments.picture, inputs)
        check_file(arguments.picture, arguments.force, _PNG, "picture (PNG)")
    body = read_body(arguments.body)
    truth = None if arguments.truth is None else read_true_motion(arguments.truth)
    with open_recording(arguments.recording) as recording:
        cameras = {camera: recording.camera_model(camera) for camera in recording.cameras if camera in body.mounts}
    with Progress(console=Terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("registrations", total=None)
        registered = registrations(arguments.recording, arguments.map, cameras, settings, arguments.jobs)

        def on_instant(what: str) -> None:
            progress.update(task, description=what, advance=1)

        compared = compare_solvers(body, cameras, registered, settings, truth, on_instant)
    console = widened(Terminal())
    console.print(solver_table(compared.as_recorded, "as recorded"))
    console.print(solver_table(compared.dark, "a quarter of the cameras dark in turn"))
    if truth is not None and arguments.picture is not None:
        with whole_file(arguments.picture) as path:
            draw_solvers(body, truth, compared, path)
        Terminal().print(f"drawn to {arguments.picture}", soft_wrap=True)
    return 0


_AGAINST_TRUTH = ("error [cm]", "worst [cm]", "error [°]", "p95 [°]", "jitter [mm]")
_COSTS = ("CPU [ms]", "p95 [ms]", "late [ms]", "memory [MB]")


def solver_table(runs: Mapping[Way, MeasuredRun], title: str) -> Table:
    """What each way costs, and how far it is from the truth where that is known."""
    is_known = any(one.errors is not None for one in runs.values())
    caption = "CPU: of an instant or its share, median; late: from an instant to its state"
    if is_known:
        caption = f"error: mean, of joints and of their rotations; {caption}"
    table = Table("way", *(_AGAINST_TRUTH if is_known else ()), *_COSTS, title=title, caption=caption)
    for way, one in runs.items():
        errors, ms = one.errors, one.run.solve_ms
        row = []
        if errors is not None:
            degrees = np.degrees(errors.rotations)
            row = [
                f"{100.0 * errors.positions.mean():.3f}",
                f"{100.0 * errors.positions.max():.2f}",
                f"{degrees.mean():.3f}",
                f"{np.percentile(degrees, 95):.2f}",
                f"{1e3 * np.nanmean(errors.jitter):.3f}",
            ]
        p95 = "-" if way.at_once else f"{np.percentile(ms, 95):.1f}"
        later = f"{one.run.latency_ms:.0f}" if np.isfinite(one.run.latency_ms) else "-"
        table.add_row(way.value, *row, f"{np.median(ms):.1f}", p95, later, f"{one.run.memory_mb:.0f}")
    return table
