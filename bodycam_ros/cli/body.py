"""bodycam body: a recorded range of motion in, a body out: skeleton and camera mounts, with a report.

With --stations static cameras measure a person who wears none: lengths and girths, from a body that is about right.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli import body_outside
from bodycam_ros.cli.body_outside import check_suffix
from bodycam_ros.cli.progress import shown_shares
from bodycam_ros.cli.settings_flags import (
    add_imu_flag,
    add_recording_flags,
    offer_settings,
    pipeline_settings,
    settings_from_flags,
)
from bodycam_ros.errors import BodyError
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.terminal import Terminal

if TYPE_CHECKING:
    from bodycam_ros.calibration.body_calibrator import CalibrationSettings


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("body", description=__doc__)
    add_recording_flags(parser, map_is_optional=True)
    add_imu_flag(parser)
    parser.add_argument("--rig", type=Path, help="YAML: camera -> segment that it is strapped to, segment -> parent")
    body_outside.add_flags(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="BODY", help="body YAML to write")
    parser.add_argument(
        "--report", type=Path, metavar="HTML", help="page with figures and a picture (default: BODY with .html)"
    )
    parser.add_argument("--name", help="name of the body (default: that of BODY)")
    parser.add_argument(
        "--facing",
        type=_degrees,
        metavar="DEGREES",
        help="where the person faces in the N-pose, about the map's z from its x (default: by hips and shoulders)",
    )
    parser.add_argument("--force", action="store_true", help="replace BODY if it is there already")
    offer_settings(parser, _settings)
    offer_settings(parser, body_outside.measure_settings)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    if arguments.stations is not None:
        return body_outside.run(arguments)
    body_outside.refuse_flags(arguments)
    if arguments.map is None or arguments.rig is None:
        raise BodyError(
            "a body is measured by worn cameras, with --map and --rig, or by static ones, with --stations, --start and "
            "--from or --height"
        )
    import numpy as np

    from bodycam_ros.body.body_file import write_body
    from bodycam_ros.body.checked_fields import name_of
    from bodycam_ros.calibration.body_calibrator import CalibrationSettings
    from bodycam_ros.calibration.rig import Rig
    from bodycam_ros.cli.lines import print_imus, print_report
    from bodycam_ros.offline.measure_body import calibrate
    from bodycam_ros.plots.body_report import write_html_report
    from bodycam_ros.plots.report_tables import body_report

    output: Path = arguments.output
    page = arguments.report or output.parent / f"{output.stem}.html"
    _check_outputs(arguments, page)
    name = name_of(arguments.name or output.stem, "--name" if arguments.name else f"{output}: the name of the body")
    pipeline = pipeline_settings(arguments)
    settings = settings_from_flags(arguments, CalibrationSettings, arguments.config)
    with shown_shares() as show:
        calibrated = calibrate(
            arguments.recording,
            arguments.map,
            Rig.from_yaml(arguments.rig),
            name,
            pipeline,
            settings,
            jobs=arguments.jobs,
            facing_rad=None if arguments.facing is None else float(np.radians(arguments.facing)),
            on_progress=show,
            imu_paths=arguments.imu,
        )
    body = replace(calibrated.body, report=body_report(calibrated.diagnosis))
    write_body(body, output)
    write_html_report(body, calibrated.diagnosis, page)
    print_report(calibrated.diagnosis)
    print_imus(body)
    Terminal().print(f"\nbody written to {output}, report to {page}", soft_wrap=True)
    return 0


def _settings() -> "type[CalibrationSettings]":
    from bodycam_ros.calibration.body_calibrator import CalibrationSettings

    return CalibrationSettings


def _degrees(text: str) -> float:
    degrees = float(text)
    if not -360.0 <= degrees <= 360.0:
        raise argparse.ArgumentTypeError("must be from -360 to 360 degrees")
    return degrees


def _check_outputs(arguments: argparse.Namespace, page: Path) -> None:
    """Refuse what cannot be written, or would cost an input, before the work is done.

    Raises:
        BodyError: the output is named as something else than a body.
        OutputError: so it is.
    """
    check_suffix(arguments.output)
    inputs = (arguments.recording, arguments.map, arguments.rig, arguments.config, *arguments.imu)
    for path, mark, what in ((arguments.output, b"segments:", "body file"), (page, b"<title>Body ", "report")):
        check_output(path, inputs, makes_folders=False)
        check_file(path, arguments.force, mark, what)
    check_output(page, (arguments.output,))
