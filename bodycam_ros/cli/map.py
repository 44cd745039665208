"""bodycam map: photographs of a place in, or a video of a walk through it, a reference map out."""

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.map_source import (
    add_source_flags,
    check_source,
    inertial_alignment,
    opened_photographs,
)
from bodycam_ros.cli.options import add_config, add_option, add_output, input_paths, read_settings
from bodycam_ros.cli.progress import ProgressBars, shown_progress
from bodycam_ros.output_place import check_output
from bodycam_ros.terminal import Terminal

if TYPE_CHECKING:
    from bodycam_ros.mapping.build import BuiltMap
    from bodycam_ros.registration.reference_map import ReferenceMap


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("map", description=__doc__)
    add_source_flags(parser)
    add_option(
        parser,
        "--board",
        help="description of the AprilTag board (default: board.yaml in REFERENCE_DIR, or beside VIDEO or BAG)",
    )
    parser.add_argument("--no-board", action="store_true", help="ignore the board: a map without scale and upward axis")
    add_output(parser, "MAP", "map folder to write")
    add_option(parser, "--jobs", help="threads (default: all cores)")
    add_config(parser, "mapping.map_settings:MapSettings")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # COLMAP and matplotlib take a second to load; the other commands and --help do without.
    from bodycam_ros.mapping.build import build_map
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.registration.reference_map import check_replaceable

    output: Path = arguments.output
    settings = read_settings(arguments, MapSettings)
    check_output(output, input_paths(arguments))
    check_replaceable(output, arguments.force)
    known = check_source(arguments)
    with shown_progress() as progress, opened_photographs(arguments, known, settings, progress) as photographs:
        board_path = None if arguments.no_board else arguments.board or photographs.board_path
        built = build_map(
            photographs,
            board_path,
            settings,
            arguments.jobs,
            progress,
            known,
            inertial_alignment(arguments, photographs),
        )
        reference_map, draw, coverage = add_coverage(built.reference_map, output.name, progress)
    replace(built, reference_map=reference_map).save(output, force=arguments.force, also=draw)
    left_out = [each.name for each in built.registrations if not each.registered]
    lines = (
        f"{sum(r.registered for r in built.registrations)} of {len(built.registrations)} photographs registered",
        *([f"NOT registered: {', '.join(left_out)}"] if left_out else ()),
        f"{len(reference_map.landmark_ids)} landmarks with {len(reference_map.descriptors)} descriptors",
        *_board_lines(built),
        _scale_line(built),
        _vertical_line(built),
        *coverage,
        f"written to {output}",
    )
    Terminal().print("\n".join(lines), soft_wrap=True)
    return 0


def add_coverage(
    reference_map: "ReferenceMap", name: str, progress: ProgressBars
) -> "tuple[ReferenceMap, Callable[[Path], None], list[str]]":
    """A map with its coverage, a function that draws it into a folder, and lines for the terminal."""
    from bodycam_ros.evaluate.coverage_picture import draw_coverage
    from bodycam_ros.mapping.coverage import COVERAGE_FILE, coverage_lines, measure_coverage, upright_map, with_coverage

    upright = upright_map(reference_map)
    coverage = measure_coverage(upright, progress)

    def draw(folder: Path) -> None:
        draw_coverage(coverage, upright, folder / COVERAGE_FILE, name)

    lines = [*coverage_lines(coverage), f"coverage is drawn in {COVERAGE_FILE} of the map"]
    return with_coverage(reference_map, coverage), draw, lines


def _board_lines(built: "BuiltMap") -> Iterator[str]:
    if (residual := built.residual) is not None:
        views = residual.views_of_tag.values()
        yield (
            f"board: {len(views)} tags, each in {min(views)} to {max(views)} photographs, residual "
            f"{residual.rms_px:.3f} px, {residual.rms_mm:.2f} mm"
        )


def _scale_line(built: "BuiltMap") -> str:
    known = built.known_scale
    if not built.reference_map.metric:
        return "NOT metric: without a board, a known distance or inertial sensors the scale is arbitrary"
    if known is not None and built.residual is not None:
        share, sigma = 100 / known.scale, 100 * known.sigma
        return f"metric, by the board; in it the known distance is {share:.1f} % of what was measured, +- {sigma:.1f} %"
    if known is not None:
        return f"metric, by a known distance: scale +- {100 * known.sigma:.1f} %; a board is more accurate"
    if built.inertial is None:
        return "metric, by the board"
    return (
        f"metric, by the inertial sensors of {built.inertial.cameras} cameras: scale "
        f"+- {100 * built.inertial.scale_sigma:.1f} %"
    )


def _vertical_line(built: "BuiltMap") -> str:
    if built.inertial is not None:
        return f"z is up, by accelerometers, +- {math.degrees(built.inertial.tilt_sigma):.2f} deg"
    if built.floor is not None:
        return f"z is up, if the floor is level: {built.floor.landmarks} landmarks lie on it"
    return (
        "z is up, from the board"
        if built.reference_map.gravity_aligned
        else "z is NOT up: there is no board, and no floor beneath body cameras"
    )
