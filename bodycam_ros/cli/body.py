"""bodycam body: a recorded range of motion in, a body out: skeleton and camera mounts, with a report.

With --stations static cameras measure a person without body cameras: lengths and girths, from an approximate body.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.text import Text

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_shape import MeasureSettings
from bodycam_ros.body.checked_fields import Name, read_entry
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.cli.options import (
    PIPELINE,
    add_config,
    add_option,
    add_output,
    add_span,
    add_topics,
    check_files,
    given_flags,
    given_span,
    number,
    pipeline_settings,
    read_settings,
    time_span,
    topic_names,
)
from bodycam_ros.cli.output import STYLES, print_sections, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import BodyError, RigError
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.replaying.measure_body import calibrate, measure_body
from bodycam_ros.replaying.worker_process import warm_up
from bodycam_ros.results.verdict import WRONG_RESULT, Level
from bodycam_ros.static_cameras.body_measurement import MeasuredBody
from bodycam_ros.static_cameras.start_file import StaticCameraFiles

EPILOG = (
    "Exit code: 0 if there is a body, 3 if the rig has cameras on the wrong segments, 1 if a file or the motion cannot "
    "be used."
)

_LENGTHS = (
    ("initial [mm]", "initial", ".0f", 1e3), ("found [mm]", "found", ".0f", 1e3), ("sigma [mm]", "sigma", ".1f", 1e3),
)  # fmt: skip
_LENGTHS_NOTE = "from joint to joint, along an axis; red: not measured, about the initial value"
_GIRTHS = (("found", "found", ".2f"), ("sigma", "sigma", ".2f"))
_GIRTHS_NOTE = "times as thick as people of this size; red: not measured"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    for name in ("recording", "--imu", "--map", "--rig"):
        add_option(parser, name)
    add_topics(parser)
    add_output(parser, "BODY", "body YAML to write, and beside it a report, BODY with .html", "BODY and its report")
    parser.add_argument("--name", help="name of the body (default: that of BODY)")
    parser.add_argument(
        "--facing",
        type=number(float, -360.0, 360.0, "degrees"),
        metavar="DEGREES",
        help="direction that the person faces in the N-pose, about the map's z from its x (default: by hips and "
        "shoulders)",
    )
    add_span(parser)
    parser.add_argument(
        "--rest-pose",
        type=time_span,
        metavar="FROM:TO",
        help="when the person stands in the N-pose, in seconds of the recording, as 12.5:15 (default: the longest time "
        "in which all cameras stand still and the limbs are straight)",
    )
    static = parser.add_argument_group("static cameras")
    static_cameras_help = (
        "instead of --rig: where static cameras are; without --map its own frame is the world. Measures lengths of "
        "bones and girths; body cameras measure the former better"
    )
    add_option(static, "--stations", help=static_cameras_help)
    start_help = (
        "with --stations: where the segments are in the first image: a file, a folder with 2-D keypoints of each "
        "camera, or auto, which detects the person in the first images"
    )
    add_option(static, "--start", help=start_help)
    add_option(static, "--person")
    initial = static.add_mutually_exclusive_group()
    body_help = "with --stations: a body with approximate lengths"
    add_option(initial, "--initial-body", metavar="BODY.YAML", needs="stations", help=body_help)
    height_help = "with --stations: start from lengths of people of this height"
    add_option(initial, "--height", needs="stations", help=height_help)
    add_option(parser, "--jobs", help="processes for the cameras (default: all cores)")
    add_config(parser, PIPELINE, "body.body_shape:MeasureSettings")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path = arguments.output
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise BodyError(f"{output}: a body is a YAML file; give a name such as legs.yaml")
    if arguments.stations is not None:
        for flag in given_flags(arguments, "rig", "facing", "rest_pose", "from_s", "to_s"):
            raise BodyError(f"{flag.removesuffix('-s')} is for body cameras; static ones, of --stations, do without")
    elif arguments.map is None or arguments.rig is None:
        raise BodyError(
            "a body is measured by body cameras, with --map and --rig, or by static ones, with --stations, --start and "
            "--initial-body or --height"
        )
    page = output.with_suffix(".html")
    reports = [(page, b"<title>Body ", "report")] if arguments.stations is None else []
    check_files(arguments, (output, b"segments:", "body file"), *reports)
    where = "--name" if arguments.name else f"{output}: the name of the body"
    name = read_entry(Name, arguments.name or output.stem, where)
    if arguments.stations is not None:
        _measure(arguments, name)
        return 0
    try:
        _calibrate(arguments, name, page)
    except RigError as error:
        Terminal().print(Text.assemble(("wrong: ", STYLES[Level.WRONG]), str(error)))
        Terminal().print("no body written")
        return WRONG_RESULT
    return 0


def _calibrate(arguments: argparse.Namespace, name: str, page: Path) -> None:
    warm_up()  # the processes for the cameras load what they need while this one does
    from bodycam_ros.evaluate.body_report import body_report, html_report  # it loads matplotlib

    pipeline = pipeline_settings(arguments)
    with shown_progress() as progress:
        calibrated = calibrate(
            arguments.recording,
            arguments.map,
            Rig.from_yaml(arguments.rig),
            name,
            pipeline,
            jobs=arguments.jobs,
            facing_rad=None if arguments.facing is None else float(np.radians(arguments.facing)),
            on_progress=progress.show,
            imu_paths=arguments.imu,
            names=topic_names(arguments),
            rest_s=arguments.rest_pose,
            span=given_span(arguments),
        )
    body = replace(calibrated.body, report=body_report(calibrated.diagnosis) | dict(calibrated.body.report))
    write_body(body, arguments.output)
    write_whole(page, html_report(body, calibrated.diagnosis))
    terminal = Terminal()
    print_report(calibrated.diagnosis, terminal)
    terminal.print(f"\nbody written to {arguments.output}, report to {page}")


def print_report(diagnosis: CalibrationDiagnosis, terminal: Terminal) -> None:
    """Print the tables of a diagnosis, then its warnings; rows with a warning are red."""
    from bodycam_ros.evaluate.body_report import report_sections, summary_line

    terminal.print(summary_line(diagnosis))
    print_sections(terminal, report_sections(diagnosis))
    for count, warning in enumerate(diagnosis.warnings, start=1):
        terminal.print(Text.assemble((f"warning {count}: ", "bold red"), warning))
    if not diagnosis.warnings:
        terminal.print("no warnings", style="green")


def _measure(arguments: argparse.Namespace, name: str) -> None:
    pipeline, settings = pipeline_settings(arguments), read_settings(arguments, MeasureSettings)
    if arguments.initial_body is not None:
        initial = read_body(arguments.initial_body)
    elif arguments.height is not None:
        initial = body_of_height(arguments.height, name)
    else:
        raise BodyError("static cameras need an approximate body: give --height in metres, or --initial-body BODY")
    with shown_progress() as progress:
        measured = measure_body(
            arguments.recording,
            arguments.map,
            initial,
            StaticCameraFiles(arguments.stations, None, arguments.start, arguments.person or 1),
            pipeline,
            settings.shape,
            progress.show,
            topic_names(arguments),
        )
    write_body(replace(measured.body, name=name, report=_measured_report(measured)), arguments.output)
    terminal = Terminal()
    lengths = {f"{each.name} {each.axis}": each for each in measured.lengths}
    girths = {each.name: each for each in measured.girths}
    vague_ones = {name for name, each in (lengths | girths).items() if not each.is_measured}
    sections = (
        column_table("lengths", "joint", _LENGTHS, lengths, _LENGTHS_NOTE, vague_ones),
        column_table("girths", "segment", _GIRTHS, girths, _GIRTHS_NOTE, vague_ones),
    )
    print_sections(terminal, sections)
    if vague := sorted({each.name for each in measured.lengths if not each.is_measured}):
        terminal.print(
            f"the recording does not measure the lengths at {', '.join(vague)}: bend these joints widely, in view of "
            "several cameras",
            style="yellow",
        )
    if not measured.converged:
        terminal.print(
            f"lengths still changed after {measured.rounds} rounds; continue with --initial-body {arguments.output}",
            style="yellow",
        )
    terminal.print(
        f"{measured.instants} frames, {measured.rounds} rounds; {measured.seen:.0%} of the segments observed"
    )
    terminal.print(f"\nbody written to {arguments.output}")


def _measured_report(measured: MeasuredBody) -> dict[str, object]:
    """Figures for the body file."""
    from bodycam_ros.evaluate.body_report import plain

    return {
        "source": "static cameras",
        **{name: plain(getattr(measured, name)) for name in ("instants", "rounds", "converged", "seen")},
        "lengths": {f"{each.name}_{each.axis}": plain(each) for each in measured.lengths},
        "girths": {each.name: plain(each) for each in measured.girths},
    }
