"""bodycam replay merge: one bag of all stretches of a recording; exit code 3 where the result should not be used."""

import argparse
from pathlib import Path

from bodycam_ros.cli.options import add_option, add_output
from bodycam_ros.cli.replay import add_inputs, given_request


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_inputs(parser)
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART", help="bag of a stretch; give all of them")
    add_option(parser, "--first", required=True, metavar="FIRST.json", help="written by 'bodycam replay first'")
    add_output(parser, "OUT", "ros2 bag folder to write")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.cli.print_replay import print_replay
    from bodycam_ros.replaying.first_pass import FirstPass
    from bodycam_ros.replaying.merge import merge_stretches

    request = given_request(arguments)
    summary = merge_stretches(request, FirstPass.read(arguments.first), arguments.parts)
    return print_replay(summary, request.recording, request.output, request.names)
