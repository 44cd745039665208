"""bodycam map: photographs of a place in, or a video of a walk through it, a reference map out."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from bodycam_ros.cli.map_from_bag import known_distances
from bodycam_ros.cli.map_source import add_source_flags, check_source, photographs_of
from bodycam_ros.cli.progress import shown_progress
from bodycam_ros.cli.settings_flags import add_jobs, offer_settings, settings_from_flags
from bodycam_ros.output_place import check_output
from bodycam_ros.shown import printable
from bodycam_ros.terminal import Terminal

if TYPE_CHECKING:
    from bodycam_ros.mapping.build import BuiltMap
    from bodycam_ros.mapping.coverage import Coverage
    from bodycam_ros.mapping.map_settings import MapSettings

_MORE = "'bodycam map check MAP' says what a map covers; a folder that is named check is given as ./check."


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("map", description=__doc__, epilog=_MORE)
    add_source_flags(parser)
    parser.add_argument(
        "--board",
        type=Path,
        help="description of the AprilTag board (default: board.yaml in REFERENCE_DIR, or beside VIDEO or BAG)",
    )
    parser.add_argument("--no-board", action="store_true", help="ignore the board: a map without scale and upward axis")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MAP", help="map folder to write")
    parser.add_argument(
        "--force", action="store_true", help="replace MAP, and DIR of --keep-frames, if it is there already"
    )
    add_jobs(parser, "threads")
    parser.add_argument("--config", type=Path, help="ROS parameter YAML with settings; flags win over it")
    offer_settings(parser, _settings)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # COLMAP and matplotlib take a second to load; the other commands and --help do without.
    from bodycam_ros.mapping.build import build_map
    from bodycam_ros.mapping.coverage import COVERAGE_FILE, measure_coverage, with_coverage
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.plots.coverage_picture import draw_coverage
    from bodycam_ros.registration.reference_map import check_replaceable

    settings = settings_from_flags(arguments, MapSettings, arguments.config)
    sources = (arguments.source, arguments.from_bag, arguments.rig, arguments.camera)
    inputs = (*sources, arguments.board, arguments.model, arguments.config)
    check_output(arguments.output, inputs)
    check_replaceable(arguments.output, arguments.force)
    check_source(arguments)
    with (
        shown_progress() as progress,
        photographs_of(arguments, settings, progress) as photographs,
    ):
        board_path = None if arguments.no_board else arguments.board or photographs.board_path
        built = build_map(
            photographs,
            board_path,
            arguments.model,
            settings,
            max(1, arguments.jobs),
            progress,
            known_distances(arguments),
        )
        coverage = measure_coverage(built.reference_map, progress)
    built = replace(built, reference_map=with_coverage(built.reference_map, coverage))
    name = f"Coverage of {printable(arguments.output.name)}"
    built.save(
        arguments.output,
        force=arguments.force,
        also=lambda folder: draw_coverage(coverage, built.reference_map, folder / COVERAGE_FILE, name),
    )
    _report(built, coverage, arguments.output)
    return 0


def _settings() -> "type[MapSettings]":
    from bodycam_ros.mapping.map_settings import MapSettings

    return MapSettings


def _report(built: "BuiltMap", coverage: "Coverage", path: Path) -> None:
    """Print what a person wants to know before trusting a map."""
    from bodycam_ros.mapping.coverage import COVERAGE_FILE, coverage_lines

    console = Terminal()
    table = Table("photograph", "registered", "landmarks", "error [px]", "tags", title="registration")
    for r in built.registrations:
        table.add_row(
            r.name,
            "yes" if r.registered else "NO",
            str(r.landmarks),
            f"{r.error_px:.2f}" if r.landmarks else "",
            str(r.tags),
        )
    console.print(table)
    if built.residual is not None:
        board = Table("tag", "photographs", "residual [px]", "residual [mm]", title="board")
        for tag, views in built.residual.views_of_tag.items():
            rms_mm = built.residual.rms_of_tag_mm.get(tag)
            board.add_row(
                str(tag),
                str(views),
                f"{built.residual.rms_of_tag_px[tag]:.3f}",
                "" if rms_mm is None else f"{rms_mm:.2f}",
            )
        board.add_row("all", "", f"{built.residual.rms_px:.3f}", f"{built.residual.rms_mm:.2f}")
        console.print(board)

    m = built.reference_map
    registered = sum(r.registered for r in built.registrations)
    seconds = ", ".join(f"{step} {took:.0f} s" for step, took in built.seconds.items())
    lines = [
        f"{registered} of {len(built.registrations)} photographs registered",
        f"{len(m.landmark_ids)} landmarks with {len(m.descriptors)} descriptors",
        seconds,
        _scale_line(built),
        _upright_line(built),
        *coverage_lines(coverage, m),
        f"written to {path}; what it covers is drawn in {path / COVERAGE_FILE}",
    ]
    console.print("\n".join(lines), soft_wrap=True)


def _scale_line(built: "BuiltMap") -> str:
    known = built.known_scale
    if not built.reference_map.metric:
        return "NOT metric: without a board or a known distance the scale is arbitrary"
    if known is None:
        return "metric, by the board"
    if built.residual is None:
        return (
            f"metric, by a known distance: lengths are known to +- {100 * known.sigma:.1f} %; a board tells them better"
        )
    share, sigma = 100 / known.scale, 100 * known.sigma
    return f"metric, by the board; in it the known distance is {share:.1f} % of what was measured, +- {sigma:.1f} %"


def _upright_line(built: "BuiltMap") -> str:
    if built.floor is not None:
        return f"z is up, if the floor is level: {built.floor.landmarks} landmarks lie on it"
    return "z is up, from the board" if built.reference_map.gravity_aligned else "z is NOT up: no board says what is"
