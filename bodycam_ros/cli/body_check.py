"""bodycam body check: what a body can do with its equipment, and what cannot be held together."""

import argparse
from pathlib import Path

from bodycam_ros.body.equipment_yaml import supplied_equipment

_DESCRIPTION = """
Before anything is recorded: how many ways there are for body and equipment to move while all that is held stays held,
what moves with what, what is said twice, and which attachments cannot be held together by such a body.
"""
_EXIT_CODES = "Exit code: 0 if everything can be held together, 3 if not, 1 if a file cannot be used."


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "body check",
        description=_DESCRIPTION,
        epilog=_EXIT_CODES,
    )
    parser.add_argument("body", type=Path, metavar="BODY", help="body file, YAML or URDF")
    parser.add_argument(
        "--equipment",
        metavar="NAME_OR_FILE",
        help="what it rides, holds or stands on: a YAML file that says where, or the name of a supplied one "
        f"({', '.join(supplied_equipment())}); default: nothing",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.body.body_file import read_body
    from bodycam_ros.body.coupled_body import held_equipment
    from bodycam_ros.body.mobility import mobility
    from bodycam_ros.cli.lines import print_mobility
    from bodycam_ros.cli.tables import WRONG_RESULT
    from bodycam_ros.terminal import Terminal

    body = read_body(arguments.body)
    equipment = None if arguments.equipment is None else held_equipment(arguments.equipment, body)
    found = mobility(body, equipment)
    print_mobility(Terminal(), found, body, equipment)
    return WRONG_RESULT if found.contradictions else 0
