"""bodycam map check: what a reference map covers, and what should be photographed too."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.progress import ProgressBars, shown_progress
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.terminal import Terminal
from bodycam_ros.whole_file import whole_file

if TYPE_CHECKING:
    from bodycam_ros.registration.reference_map import ReferenceMap

_PNG = b"\x89PNG"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("map check", description=__doc__)
    parser.add_argument("map", type=Path, metavar="MAP", help="folder made by 'bodycam map'")
    parser.add_argument("-o", "--output", type=Path, metavar="PNG", help="draw it: directions, and places from above")
    parser.add_argument("--force", action="store_true", help="replace PNG if it exists already")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.evaluate.coverage_picture import draw_coverage
    from bodycam_ros.mapping.coverage import coverage_lines, measure_coverage, upright_map
    from bodycam_ros.registration.reference_map import ReferenceMap

    if arguments.output is not None:
        check_output(arguments.output, (arguments.map,), makes_folders=False)
        check_file(arguments.output, arguments.force, _PNG, "picture (PNG)")
    reference_map = upright_map(ReferenceMap.load(arguments.map))
    with shown_progress() as progress:
        coverage = measure_coverage(reference_map, progress)
    lines = coverage_lines(coverage)
    if arguments.output is not None:
        with whole_file(arguments.output) as unfinished:
            draw_coverage(coverage, reference_map, unfinished, arguments.map.resolve().name)
        lines.append(f"drawn in {arguments.output}")
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
