"""bodycam replay stretch: solve one stretch of a long recording, with one core, for 'replay merge'."""

import argparse
from dataclasses import replace

from bodycam_ros.cli.options import add_option, add_output, number
from bodycam_ros.cli.replay import add_inputs, given_request


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_inputs(parser)
    add_option(parser, "--first", required=True, metavar="FIRST.json", help="written by 'bodycam replay first'")
    parser.add_argument(
        "--number", type=number(int, 1, 10000), required=True, metavar="K", help="which stretch, from 1"
    )
    add_output(parser, "PART", "ros2 bag folder of the stretch to write")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    import cv2

    from bodycam_ros.cli.output import shown_progress
    from bodycam_ros.cli.terminal import Terminal
    from bodycam_ros.replaying.first_pass import FirstPass
    from bodycam_ros.replaying.replay import replay

    cv2.setNumThreads(1)
    first, stretch = FirstPass.read(arguments.first), arguments.number - 1
    first.stretch_ns(stretch)
    request = replace(given_request(arguments), first=first, stretch=stretch)
    with shown_progress() as progress:
        summary = replay(request, progress.show)
    Terminal().print(
        f"stretch {arguments.number} of {first.count}: {summary.solved} states of {summary.recorded_s:.1f} s; "
        f"written to {arguments.output}"
    )
    return 0
