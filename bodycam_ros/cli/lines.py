"""The cameras' clocks on the terminal."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.progress import Progress, TaskID
from rich.table import Table
from rich.text import Text

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.mobility import Contradiction, Mobility
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.mapping.growth_settings import ExtensionRound
from bodycam_ros.offline.extend import OnProgress
from bodycam_ros.offline.replay_output import clock_remarks, seconds_into
from bodycam_ros.plots.report_tables import ReportTable, report_tables, summary_line
from bodycam_ros.terminal import Terminal
from bodycam_ros.timing.clock_state import ClockHistory, ClockJump


def print_clocks(
    console: Terminal,
    timings: Mapping[str, ClockHistory],
    jumps: Iterable[ClockJump],
    speeds: Mapping[str, tuple[float, float]],
) -> None:
    """Print a table of the clocks that were off, and a line for each that a person should know of."""
    jumps = list(jumps)
    off = {camera: timing for camera, timing in sorted(timings.items()) if timing.is_off}
    off |= {jump.camera: timings[jump.camera] for jump in jumps if jump.camera in timings}
    right = [timing.latest.offset_sigma for camera, timing in timings.items() if camera not in off]
    if off:
        console.print(_table(off, jumps))
        if right:
            console.print(f"the other {len(right)} clocks were right, as far as they are known: +-{_ms(max(right))} ms")
    for line in clock_remarks(timings, jumps, speeds):
        console.print(line, soft_wrap=True)


def _table(off: Mapping[str, ClockHistory], jumps: list[ClockJump]) -> Table:
    table = Table(caption="ahead of the others' (+) or behind; corrected; a clock that was set: as it was at last")
    table.add_column("camera")
    for column in ("clock [ms]", "+-", "drift [ppm]", "+-"):
        table.add_column(column, justify="right")
    table.add_column("set")
    for camera, timing in sorted(off.items()):
        clock = timing.latest
        when = (
            f"{1e3 * jump.by_s:+.0f} ms after {seconds_into(timing, jump):.1f} s"
            for jump in jumps
            if jump.camera == camera
        )
        table.add_row(
            camera,
            f"{1e3 * clock.offset:+.1f}",
            _ms(clock.offset_sigma),
            f"{1e6 * clock.drift:+.0f}",
            f"{1e6 * clock.drift_sigma:.0f}",
            ", ".join(when),
        )
    return table


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f}"


def shown_steps(bars: Progress) -> OnProgress:
    """What shows every step as a bar of its own."""
    tasks: dict[str, TaskID] = {}

    def show(step: str, share: float) -> None:
        if step not in tasks:
            tasks[step] = bars.add_task(step, total=1.0)
        bars.update(tasks[step], completed=share)

    return show


def print_rounds(rounds: Sequence[ExtensionRound]) -> None:
    """Share of registered images per camera and round."""
    heads = [f"round {number + 1}" for number in range(len(rounds))]
    table = Table("camera", *heads, title="images registered [%]")
    for camera in sorted(rounds[0].shares):
        table.add_row(camera, *[f"{100 * one.shares[camera]:.1f}" for one in rounds])
    table.add_row("all", *[f"{100 * one.share:.1f}" for one in rounds], style="bold")
    Terminal().print(table)
    Terminal().print(f"{100 * rounds[0].absolute:.1f} % of all images are held by landmarks of the photographs")


WIDTH = 100
"""Columns that a report needs, and has where it goes to a file or pipe whose width nobody knows."""

_LIST_WIDTH = 27
"""Columns of a list at the end of a row; it takes several lines before a figure does."""

_LOOK_HERE = "bold red"


def print_report(diagnosis: CalibrationDiagnosis, console: Console | None = None) -> None:
    """Print the tables of a diagnosis, then its warnings; rows that a warning speaks of are red."""
    console = console or Terminal()
    if not console.is_terminal:
        console.width = max(console.width, WIDTH)
    for part in terminal_report(diagnosis).renderables:
        console.print(part)


def print_imus(body: BodyModel) -> None:
    """Print the calibrations of the cameras' inertial sensors, if there are any."""
    imus = {camera: mount.imu for camera, mount in body.mounts.items() if mount.imu is not None}
    if not imus:
        return
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, title="inertial sensors", title_justify="left")
    for heading in ("camera", "rotation +- [deg]", "time offset [ms]", "+-", "gyro bias [deg/s]", "+-"):
        table.add_column(Text(heading), justify="left" if heading == "camera" else "right")
    for camera, imu in imus.items():
        numbers = (np.degrees(imu.rotation_sigma), 1e3 * imu.time_offset, 1e3 * imu.time_offset_sigma)
        biases = (np.degrees(np.linalg.norm(imu.gyro_bias)), np.degrees(imu.gyro_bias_sigma))
        table.add_row(camera, *(f"{number:.3f}" for number in (*numbers, *biases)))
    Terminal().print(table)


def terminal_report(diagnosis: CalibrationDiagnosis) -> Group:
    """What ``print_report`` prints."""
    parts: list[RenderableType] = [Text(summary_line(diagnosis))]
    for table in report_tables(diagnosis):
        parts += [
            Text(),
            Text.assemble((table.title, "bold"), "  ", (table.note, "dim")),
            _body_table(table),
        ]
    return Group(*parts, *_warnings(diagnosis))


def _body_table(content: ReportTable) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for index, heading in enumerate(content.columns):
        justify: Literal["left", "right"] = "left" if index in content.text_columns else "right"
        # Text, not str: square brackets hold units here, not rich's markup. Folded, no letter is lost on any width.
        table.add_column(
            Text(heading.replace(" [", "\n[")),
            justify=justify,
            overflow="fold",
            max_width=_LIST_WIDTH if heading == content.columns[-1] else None,
        )
    for index, row in enumerate(content.rows):
        table.add_row(*map(Text, row), style=_LOOK_HERE if index in content.flagged else None)
    return table


def _warnings(diagnosis: CalibrationDiagnosis) -> list[RenderableType]:
    if not diagnosis.warnings:
        return [Text("no warnings", style="green")]
    listed = Table.grid(padding=(0, 1))
    for number, warning in enumerate(diagnosis.warnings, start=1):
        listed.add_row(Text(f"{number}.", style=_LOOK_HERE), Text(warning))
    return [Text("look at", style=_LOOK_HERE), listed]


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
        yield f"loops and ground: {found.rows} rows, {found.rank} of them independent"
    whole = f", {found.as_a_whole} of them of all together in the world" if found.as_a_whole else ""
    yield f"in truth: {found.freedoms} freedoms{' without what contradicts' if found.contradictions else ''}{whole}"


def _motions(found: Mobility) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("degrees of freedom")
    table.add_column("", justify="right")
    table.add_column("joints, the largest motion first", overflow="fold")
    if found.as_a_whole:
        table.add_row("all together", str(found.as_a_whole), Text("in the world"))
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
