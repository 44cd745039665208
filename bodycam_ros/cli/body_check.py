"""bodycam body check: degrees of freedom of a body with its equipment, and constraints that conflict.

Before anything is recorded: the degrees of freedom of body and equipment, joints that move together, redundant
constraints, and attachments that this body cannot satisfy together.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import held_equipment
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.mobility import Contradiction, Mobility, mobility
from bodycam_ros.cli.options import add_equipment
from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict import WRONG_RESULT

EPILOG = "Exit code: 0 if all constraints can be satisfied, 3 if not, 1 if a file cannot be used."
_MAX_SIGMAS = 2.0  # of a length; beyond it the needed change is printed


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
    terminal.print("\n".join(_counts(found, body, equipment)))
    terminal.print(_motions(found))
    for line in _remarks(found):
        terminal.print(line)
    for contradiction in found.contradictions:
        terminal.print(Text.assemble(("conflict: ", "bold red"), _conflict(contradiction)))
    if not found.contradictions:
        terminal.print(Text("verdict: all constraints can be satisfied", "green"))
        return 0
    names = ", ".join(contradiction.name for contradiction in found.contradictions)
    against = sorted({other for contradiction in found.contradictions for other in contradiction.against})
    terminal.print(
        Text(
            f"verdict: constraints conflict; measure the points of {names} again, and of "
            f"{', '.join(against) or 'the other attachments'}; or leave {names} out",
            "bold red",
        )
    )
    return WRONG_RESULT


def _counts(found: Mobility, body: BodyModel, equipment: Equipment | None) -> Iterator[str]:
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
    without = " without the conflicting constraints" if found.contradictions else ""
    yield f"by rank: {found.freedoms} degrees of freedom{without}{whole}"


def _motions(found: Mobility) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("degrees of freedom")
    table.add_column("", justify="right")
    table.add_column("joints, the largest motion first", overflow="fold")
    if found.as_a_whole:
        table.add_row("as a whole", str(found.as_a_whole), Text("in the world"))
    if found.untouched:
        table.add_row("each on its own", str(sum(found.untouched.values())), Text(", ".join(found.untouched)))
    if found.within_loops:
        table.add_row("within the loops", str(found.within_loops), "")
    for joint, others in found.coupled.items():
        table.add_row(Text(f"  {joint} moves"), "", Text(", ".join(others)))
    return table


def _remarks(found: Mobility) -> Iterator[str]:
    for joint in found.stuck:
        yield f"cannot move: {joint}"
    for name, rows in found.redundant.items():
        yield f"redundant: {rows} rows of {name} follow from the others"
    for name, (longer, sigma) in found.lengths.items():
        x, y, z = 1e3 * sigma
        text = f"estimated: {name}, with a sigma of {x:.0f}, {y:.0f}, {z:.0f} mm"
        far = np.abs(longer) > _MAX_SIGMAS * np.maximum(sigma, 1e-6)
        yield f"{text}; it would have to be {1e3 * np.linalg.norm(longer):.0f} mm off" if far.any() else text
    for name, (angle, excess) in found.beyond_limits.items():
        yield (
            f"beyond the range of motion: {name} would be at {np.degrees(angle):.0f} deg, "
            f"{abs(np.degrees(excess)):.0f} deg too far"
        )


def _conflict(contradiction: Contradiction) -> str:
    text = f"{contradiction.name} stays {1e3 * contradiction.apart_m:.0f} mm apart"
    if contradiction.turned_rad > np.radians(1.0):
        text += f" and turned by {np.degrees(contradiction.turned_rad):.0f} deg"
    text += " while all other constraints hold"
    if contradiction.against:
        return f"{text}; it can be satisfied without {' or '.join(contradiction.against)}"
    return f"{text}; to release any one other is not enough"
