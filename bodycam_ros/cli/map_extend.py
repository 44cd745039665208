"""bodycam map extend: a map and a recording in, a map out that shows what the recording's cameras saw too (A 4.1)."""

import argparse
from contextlib import nullcontext
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from bodycam_ros.cli.progress import shown_progress
from bodycam_ros.cli.settings_flags import add_recording_flags, pipeline_settings
from bodycam_ros.output_place import check_output
from bodycam_ros.shown import printable
from bodycam_ros.terminal import Terminal

_PICTURE = "rounds.png"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("map extend", description=__doc__)
    parser.add_argument("map", type=Path, metavar="MAP", help="reference map, a folder made by 'bodycam map'")
    add_recording_flags(parser, with_map=False)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MAP2", help="map folder to write")
    parser.add_argument("--force", action="store_true", help="replace MAP2 if it is there already")
    parser.add_argument("--tell", action="store_true", help="for programs: say how far it is as lines of JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.cli.lines import print_rounds, shown_steps
    from bodycam_ros.cli.progress import ToldProgress
    from bodycam_ros.mapping.coverage import COVERAGE_FILE, coverage_lines, measure_coverage, with_coverage
    from bodycam_ros.offline.extend import extend_map
    from bodycam_ros.plots.coverage_picture import draw_coverage
    from bodycam_ros.plots.rounds_picture import draw_rounds
    from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable

    settings = pipeline_settings(arguments)
    check_output(arguments.output, (arguments.map, arguments.recording, arguments.config))
    check_replaceable(arguments.output, arguments.force)
    settled = len(ReferenceMap.load(arguments.map).landmark_ids)
    told = ToldProgress() if arguments.tell else None
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Terminal(stderr=True), disable=arguments.tell) as bars:
        on_progress = told.tell if told else shown_steps(bars)
        extension = extend_map(arguments.recording, arguments.map, settings, arguments.jobs, on_progress=on_progress)
    extended = extension.reference_map
    with nullcontext(told) if told else shown_progress() as progress:
        coverage = measure_coverage(extended, progress)
    extended = with_coverage(extended, coverage)
    recorded = "/".join(arguments.recording.resolve().parts[-2:])
    title = f"{printable(arguments.map.resolve().name)}, extended by {printable(recorded)}"

    def draw(folder: Path) -> None:
        draw_rounds(extension.rounds, extended, settled, folder / _PICTURE, title)
        draw_coverage(coverage, extended, folder / COVERAGE_FILE, f"Coverage of {printable(arguments.output.name)}")

    extended.save(arguments.output, force=arguments.force, also=draw)
    print_rounds(extension.rounds)
    Terminal().print("\n".join(coverage_lines(coverage, extended)), soft_wrap=True)
    Terminal().print(
        f"{extended.grown} landmarks added by body cameras to {settled}, {len(extended.image_names)} pictures; "
        f"written to {arguments.output}, drawn in {arguments.output / _PICTURE}",
        soft_wrap=True,
    )
    return 0
