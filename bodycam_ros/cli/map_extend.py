"""bodycam map extend: add landmarks that the body cameras of a recording see to a map, and write a new map."""

import argparse

from bodycam_ros.cli.map import add_coverage
from bodycam_ros.cli.options import PIPELINE, add_config, add_option, add_output, input_paths, pipeline_settings
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.cli.print_replay import print_rounds
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.files.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable
from bodycam_ros.replaying.extend import extend_map


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_option(parser, "recording")
    add_option(parser, "--map", required=True)
    add_output(parser, "MAP2", "map folder to write")
    add_option(parser, "--jobs", help="processes for the cameras (default: all cores)")
    add_config(parser, PIPELINE)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    recording, output = arguments.recording, arguments.output
    settings = pipeline_settings(arguments)
    check_output(output, input_paths(arguments))
    check_replaceable(output, arguments.force)
    known = len(ReferenceMap.load(arguments.map).landmark_ids)
    with shown_progress() as progress:
        extended, rounds = extend_map(recording, arguments.map, settings, arguments.jobs, on_progress=progress.show)
        extended, draw, coverage = add_coverage(extended, output.name, progress)
    extended.save(output, force=arguments.force, also=draw)
    print_rounds(rounds)
    Terminal().print(
        *coverage,
        f"{extended.grown} landmarks added by body cameras to {known}, {len(extended.image_names)} pictures; "
        f"written to {output}",
        sep="\n",
    )
    return 0
