"""bodycam view: look at map, body and recording in a browser, and correct mounts and joints (A 4.2)."""

import argparse
from pathlib import Path

PORT = 8080


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("view", help="look at a body in a browser, and correct it", description=__doc__)
    parser.add_argument(
        "solved",
        type=Path,
        nargs="?",
        metavar="OUT",
        help="bag that 'bodycam replay' wrote (without it: the body in its N-pose)",
    )
    parser.add_argument(
        "--map", type=Path, metavar="MAP", help="map folder of 'bodycam map'; may be left out with --stations"
    )
    parser.add_argument("--body", type=Path, required=True, metavar="BODY.yaml", help="body, which can be written back")
    parser.add_argument(
        "--recording", type=Path, metavar="BAG", help="bag that OUT was solved from: shows what the cameras saw"
    )
    parser.add_argument(
        "--stations", type=Path, metavar="CAMERAS.YAML", help="where static cameras stand: shows them and what they saw"
    )
    parser.add_argument(
        "--surface",
        type=Path,
        metavar="FOLDER",
        help="a mesh a segment to show on the body (default: the folder that the body file names, else capsules)",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="OUT2", help="another bag solved from the same recording, shown beside OUT"
    )
    parser.add_argument("--port", type=int, default=PORT, help=f"of this machine; 0 takes any free one ({PORT})")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # The web server takes half a second to load; the other commands and --help do without.
    from bodycam_ros.view.session import view

    view(
        arguments.solved,
        arguments.map,
        arguments.body,
        arguments.recording,
        arguments.port,
        arguments.stations,
        arguments.surface,
        arguments.compare,
    )
    return 0
