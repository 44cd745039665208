"""bodycam body check: degrees of freedom of a body with its equipment, and constraints that conflict.

Before anything is recorded: the degrees of freedom of body and equipment, joints that move together, and attachments
that this body cannot satisfy together.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.text import Text

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import held_equipment
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.mobility import Conflict, Mobility, mobility
from bodycam_ros.cli.options import add_equipment
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.results.verdict import WRONG_RESULT

EPILOG = "Exit code: 0 if all constraints can be satisfied, 3 if not, 1 if a file cannot be used."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("body", type=Path, metavar="BODY", help="body file, YAML or URDF")
    add_equipment(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    body = read_body(arguments.body)
    equipment = None if arguments.equipment is None else held_equipment(arguments.equipment, body)
    found = mobility(body, equipment)
    terminal = Terminal()
    terminal.print("\n".join(_lines(found, body, equipment)))
    for conflict in found.conflicts:
        terminal.print(Text.assemble(("conflict: ", "bold red"), _conflict(conflict)))
    if not found.conflicts:
        terminal.print(Text("verdict: all constraints can be satisfied", "green"))
        return 0
    names = ", ".join(conflict.name for conflict in found.conflicts)
    verdict = f"verdict: constraints conflict; measure the points of all attachments again, or leave {names} out"
    terminal.print(Text(verdict, "bold red"))
    return WRONG_RESULT


def _lines(found: Mobility, body: BodyModel, equipment: Equipment | None) -> Iterator[str]:
    count = found.count
    constrained = sum(6 - freedoms for freedoms in count.joints.values())
    yield f"{body.name} {f'with {equipment.name}' if equipment else 'alone'}: {len(count.joints)} joints"
    leaning = f" - {count.leaning} that keep it upright" if count.leaning else ""
    yield (
        f"Gruebler's count: 6 x {count.links} segments - {constrained} constraints of joints{leaning} "
        f"= {count.freedoms} degrees of freedom"
    )
    if found.rows:
        yield f"loops and ground: {found.rows} rows, {found.rank} of them independent"
    whole = f", {found.as_a_whole} of them as a whole in the world" if found.as_a_whole else ""
    without = " without the conflicting constraints" if found.conflicts else ""
    yield f"by rank: {found.freedoms} degrees of freedom{without}{whole}"
    for joint, others in found.coupled.items():
        yield f"{joint} moves {', '.join(others) or 'alone'}"
    for joint in found.stuck:
        yield f"cannot move: {joint}"


def _conflict(conflict: Conflict) -> str:
    text = f"{conflict.name} stays {1e3 * conflict.apart_m:.0f} mm apart"
    if conflict.turned_rad > np.radians(1.0):
        text += f" and turned by {np.degrees(conflict.turned_rad):.0f} deg"
    return f"{text} while all other constraints hold"
