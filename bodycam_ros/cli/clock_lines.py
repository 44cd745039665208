"""The cameras' clocks on the terminal."""

from collections.abc import Iterable, Mapping

from rich.table import Table

from bodycam_ros.offline.clock_remarks import clock_remarks, seconds_into
from bodycam_ros.terminal import Terminal
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockJump


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
