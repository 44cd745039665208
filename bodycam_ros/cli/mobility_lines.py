"""What a mechanism can do, in a table and in plain words."""

from collections.abc import Iterator

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.mobility.closing import Contradiction
from bodycam_ros.mobility.mobility import Mobility
from bodycam_ros.terminal import Terminal

_WIDTH = 100
"""Columns where it goes to a file or pipe whose width nobody knows."""

_LONG = 2.0  # [sigma] of a length that is surprising


def print_mobility(terminal: Terminal, found: Mobility, body: BodyModel, equipment: Equipment | None) -> None:
    """Print counts, motions and what is said twice; what contradicts, and the verdict, come last."""
    if not terminal.is_terminal:
        terminal.width = max(terminal.width, _WIDTH)
    terminal.print("\n".join(_counts(found, body, equipment)), soft_wrap=True)
    terminal.print(_motions(found))
    for line in _remarks(found):
        terminal.print(line, soft_wrap=True)
    for contradiction in found.contradictions:
        terminal.print(Text.assemble(("contradicts: ", "bold red"), _apart(contradiction)), soft_wrap=True)
    if found.contradictions:
        names = ", ".join(contradiction.name for contradiction in found.contradictions)
        against = {other for contradiction in found.contradictions for other in contradiction.against}
        verdict = (
            f"verdict: cannot be held together; measure the points of {names} again, and of "
            f"{', '.join(sorted(against)) or 'the other attachments'}; or leave {names} out"
        )
        terminal.print(Text(verdict, "bold red"), soft_wrap=True)
    else:
        terminal.print(Text("verdict: everything can be held together", "green"), soft_wrap=True)


def _counts(found: Mobility, body: BodyModel, equipment: Equipment | None) -> Iterator[str]:
    count = found.count
    held = sum(6 - freedoms for freedoms in count.joints.values())
    yield f"{body.name} {f'with {equipment.name}' if equipment else 'alone'}: {len(count.joints)} joints"
    leaning = f" - {count.leaning} that keep it upright" if count.leaning else ""
    yield (
        f"Gruebler's count: 6 x {count.links} segments - {held} that the joints hold{leaning} "
        f"= {count.freedoms} freedoms"
    )
    if found.rows:
        low, high = found.rank_along or (None, None)
        along = "" if low is None else f"; along motions {low}" if low == high else f"; along motions {low} to {high}"
        yield f"loops and ground: {found.rows} rows, {found.rank} of them independent{along}"
    whole = f", {found.parts.as_a_whole} of them of all together in the world" if found.parts.as_a_whole else ""
    yield f"in truth: {found.freedoms} freedoms{' without what contradicts' if found.contradictions else ''}{whole}"


def _motions(found: Mobility) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("what moves")
    table.add_column("freedoms", justify="right")
    table.add_column("what moves with it, the most first", overflow="fold")
    for motion in found.parts.led:
        joints = ", ".join(motion.with_joints)
        table.add_row(Text(motion.joint), str(motion.freedoms), Text(joints))
    parts = found.parts
    if parts.others:
        table.add_row("else, within the loops", str(parts.others), Text(", ".join(parts.of_others)))
    if parts.untouched:
        table.add_row("each on its own", str(sum(parts.untouched.values())), Text(", ".join(parts.untouched)))
    if parts.as_a_whole:
        table.add_row("all together", str(parts.as_a_whole), Text("in the world"))
    return table


def _remarks(found: Mobility) -> Iterator[str]:
    for joint in found.parts.stuck:
        yield f"cannot move: {joint}"
    for row, same in found.redundant.items():
        yield f"said twice: {row}; so do {', '.join(same)}"
    for name, (longer, sigma) in found.longer.items():
        given = 1e3 * sigma
        said = (
            f"estimated: {name}, which may be {given[0]:.0f}, {given[1]:.0f}, {given[2]:.0f} mm from where it is said"
        )
        far = np.abs(longer) > _LONG * np.maximum(sigma, 1e-6)
        yield f"{said}; it would have to be {1e3 * np.linalg.norm(longer):.0f} mm off" if far.any() else said
    for name, (angle, excess) in found.beyond_limits.items():
        yield (
            f"beyond the range of motion: {name} would be at {np.degrees(angle):.0f} deg, "
            f"{abs(np.degrees(excess)):.0f} deg too far"
        )


def _apart(contradiction: Contradiction) -> str:
    text = f"{contradiction.name} stays {1e3 * contradiction.apart_m:.0f} mm apart"
    if contradiction.turned_rad > np.radians(1.0):
        text += f" and turned by {np.degrees(contradiction.turned_rad):.0f} deg"
    text += " while all else is held"
    if contradiction.against:
        return f"{text}; it holds without {' or '.join(contradiction.against)}"
    return f"{text}; to let go of any one other is not enough"
