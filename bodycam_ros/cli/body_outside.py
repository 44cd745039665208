"""bodycam body --stations: static cameras measure a person who wears none."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from bodycam_ros.cli.progress import shown_shares
from bodycam_ros.cli.settings_flags import pipeline_settings, settings_from_flags
from bodycam_ros.errors import BodyError, StationError
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.terminal import Terminal

if TYPE_CHECKING:
    from bodycam_ros.body.body_model import BodyModel
    from bodycam_ros.static_cameras.body_from_outside import MeasuredBody
    from bodycam_ros.static_cameras.body_shape import MeasureSettings

_SUFFIXES = (".yaml", ".yml")
_MM_PER_M = 1000.0


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add those that static cameras need."""
    parser.add_argument(
        "--stations",
        type=Path,
        metavar="CAMERAS.YAML",
        help="instead of --rig: where static cameras stand that see the person; without --map its own frame is the "
        "world. Lengths of bones and girths are measured; worn cameras tell the former better",
    )
    parser.add_argument(
        "--start",
        type=Path,
        metavar="START.YAML",
        help="with --stations: where the segments are in the first image, placed by hand",
    )
    begun = parser.add_mutually_exclusive_group()
    begun.add_argument(
        "--from", type=Path, dest="begun", metavar="BODY.YAML", help="with --stations: a body whose lengths are off"
    )
    begun.add_argument(
        "--height", type=float, metavar="METRES", help="with --stations: begin with people of this height"
    )


def measure_settings() -> "type[MeasureSettings]":
    """Groups of settings beside those of all stages."""
    from bodycam_ros.static_cameras.body_shape import MeasureSettings

    return MeasureSettings


def refuse_flags(arguments: argparse.Namespace) -> None:
    """Refuse flags of static cameras where there are none.

    Raises:
        StationError: there are.
    """
    for flag, value in (("start", arguments.start), ("from", arguments.begun), ("height", arguments.height)):
        if value is not None:
            raise StationError(f"--{flag} is for static cameras: say with --stations where they stand")


def check_suffix(path: Path) -> None:
    """Refuse an output that is named as something else than a body.

    Raises:
        BodyError: it is.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise BodyError(f"{path}: a body is kept as YAML; give a name such as legs.yaml")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print what was found, write the body."""
    from bodycam_ros.body.body_file import write_body
    from bodycam_ros.body.checked_fields import name_of
    from bodycam_ros.offline.measure_body import measure_body
    from bodycam_ros.static_cameras.start_file import OutsideInput

    output: Path = arguments.output
    for flag in ("rig", "report", "facing"):
        if getattr(arguments, flag) is not None:
            raise BodyError(f"--{flag} is for worn cameras; static ones, of --stations, do without")
    check_suffix(output)
    inputs = (arguments.recording, arguments.map, arguments.stations, arguments.start, arguments.begun)
    check_output(output, (*inputs, arguments.config), makes_folders=False)
    check_file(output, arguments.force, b"segments:", "body file")
    name = name_of(arguments.name or output.stem, "--name" if arguments.name else f"{output}: the name of the body")
    pipeline = pipeline_settings(arguments)
    settings = settings_from_flags(arguments, measure_settings(), arguments.config)
    begun = _begun(arguments, name)
    with shown_shares() as show:
        measured = measure_body(
            arguments.recording,
            arguments.map,
            begun,
            OutsideInput(arguments.stations, None, arguments.start),
            pipeline,
            settings.shape,
            show,
        )
    write_body(replace(measured.body, name=name, report=_report(measured)), output)
    _print(measured)
    Terminal().print(f"\nbody written to {output}", soft_wrap=True)
    return 0


def _begun(arguments: argparse.Namespace, name: str) -> "BodyModel":
    """The body that is begun with.

    Raises:
        BodyError: there is none, or it is nobody's.
    """
    from bodycam_ros.body.body_file import read_body
    from bodycam_ros.static_cameras.body_from_outside import body_of_height

    if arguments.begun is not None:
        return read_body(arguments.begun)
    if arguments.height is None:
        raise BodyError("static cameras begin with a body that is about right: give --height in metres, or --from BODY")
    return body_of_height(arguments.height, name)


def _report(measured: "MeasuredBody") -> dict[str, object]:
    """Figures for the body file."""
    return {
        "source": "static cameras",
        "instants": measured.instants,
        "rounds": measured.rounds,
        "converged": measured.converged,
        "seen": round(measured.seen, 3),
        "lengths": {
            f"{each.name}_{each.axis}": {
                "begun": round(each.begun, 4), "found": round(each.found, 4), "sigma": round(each.sigma, 4),
                "told": each.told,
            }
            for each in measured.lengths
        },
        "girths": {
            each.name: {"found": round(each.found, 3), "sigma": round(each.sigma, 3), "told": each.told}
            for each in measured.girths
        },
    }  # fmt: skip


def _print(measured: "MeasuredBody") -> None:
    terminal = Terminal()
    lengths = Table(title="lengths", caption="from joint to joint; those not told are about what was begun with")
    lengths.add_column("joint", no_wrap=True)
    lengths.add_column("along")
    for column in ("begun [mm]", "found [mm]", "sigma [mm]"):
        lengths.add_column(column, justify="right")
    lengths.add_column("told")
    for each in measured.lengths:
        figures = (f"{_MM_PER_M * abs(value):.0f}" for value in (each.begun, each.found))
        sigma = f"{_MM_PER_M * each.sigma:.1f}"
        lengths.add_row(each.name, each.axis, *figures, sigma, _told(each.told), style=None if each.told else "yellow")
    terminal.print(lengths)
    girths = Table(title="girths", caption="times as thick as people of this size")
    girths.add_column("segment", no_wrap=True)
    for column in ("found", "sigma"):
        girths.add_column(column, justify="right")
    girths.add_column("told")
    for each in measured.girths:
        told = _told(each.told)
        girths.add_row(each.name, f"{each.found:.2f}", f"{each.sigma:.2f}", told, style=None if each.told else "yellow")
    terminal.print(girths)
    if vague := sorted({each.name for each in measured.lengths if not each.told}):
        terminal.print(
            f"the recording does not tell the lengths at {', '.join(vague)}: bend these joints widely, in view of "
            "several cameras",
            style="yellow",
            soft_wrap=True,
        )
    if not measured.converged:
        terminal.print(
            f"lengths still changed after {measured.rounds} rounds; give this body as --from to go on",
            style="yellow",
            soft_wrap=True,
        )
    terminal.print(
        f"{measured.instants} instants asked in {measured.rounds} rounds; {measured.seen:.0%} of the segments seen"
    )


def _told(told: bool) -> str:
    return "yes" if told else "no"
