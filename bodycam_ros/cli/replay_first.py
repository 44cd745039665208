"""bodycam replay first: clocks, read-out times and stretches of a long recording, for 'replay stretch' and 'merge'."""

import argparse

from bodycam_ros.cli.options import add_output, check_files, number
from bodycam_ros.cli.replay import add_inputs, given_request
from bodycam_ros.replaying.worker_process import warm_up

EPILOG = """Give all three steps the same inputs and options:

  bodycam replay first BAG --map MAP --body body.yaml --stretches 64 -o first.json
  bodycam replay stretch BAG --map MAP --body body.yaml --first first.json --number 1 -o parts/1
  bodycam replay merge BAG --map MAP --body body.yaml --first first.json parts/* -o OUT"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_inputs(parser)
    add_output(parser, "FIRST.json", "file to write")
    parser.add_argument(
        "--stretches", type=number(int, 1, 10000), required=True, metavar="N", help="how many, of half a minute or more"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    warm_up()
    from bodycam_ros.cli.output import shown_progress
    from bodycam_ros.cli.terminal import Terminal
    from bodycam_ros.replaying.first_pass import FIRST_PASS_MARK
    from bodycam_ros.replaying.make_first_pass import make_first_pass

    request = given_request(arguments, writes_bag=False)
    check_files(arguments, (arguments.output, FIRST_PASS_MARK, "file of 'bodycam replay first'"))
    with shown_progress() as progress:
        first = make_first_pass(request, arguments.stretches, on_step=progress.show)
    first.write(arguments.output)
    seconds = 1e-9 * (first.bounds_ns[-1] - first.bounds_ns[0])
    Terminal().print(f"{first.count} stretches of {seconds:.1f} s; written to {arguments.output}")
    return 0
