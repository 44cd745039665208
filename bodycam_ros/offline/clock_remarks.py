"""What a person should know of the clocks that a replay corrected."""

import math
from collections.abc import Iterable, Iterator, Mapping

from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockJump, ClockState

_WORTH_SAYING_S = 0.003
"""A limb at 3 m/s is 1 cm further by then."""

_POORLY_KNOWN_S = 0.004
_UP_TO_SIGMAS = 2.0


def clock_remarks(
    timings: Mapping[str, ClockHistory],
    jumps: Iterable[ClockJump],
    speeds: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """A line for every clock that was off, was set, or stayed unknown.

    Args:
        timings: camera -> how its clock went.
        jumps: of clocks that were set.
        speeds: camera -> how fast it turned and moved [rad/s, m/s].
    """
    jumps = list(jumps)
    lines = []
    for camera, timing in sorted(timings.items()):
        of_camera = [jump for jump in jumps if jump.camera == camera]
        speed = speeds.get(camera, (math.nan, math.nan))
        lines += [f"camera {camera}: {remark}" for remark in _of_camera(timing, of_camera, speed)]
    return tuple(lines)


def seconds_into(timing: ClockHistory, jump: ClockJump) -> float:
    """How long a camera had recorded when its clock was set [s]."""
    return 1e-9 * (jump.stamp_ns - timing.clocks[0].since_ns)


def _of_camera(timing: ClockHistory, jumps: list[ClockJump], speed: tuple[float, float]) -> Iterator[str]:
    first = timing.clocks[0]
    if timing.is_off and abs(first.offset) > max(_WORTH_SAYING_S, 2.0 * first.offset_sigma):
        drifted = f", and drifted by {1e6 * first.drift:+.0f} ppm" if _drifts(first) else ""
        side = "ahead" if first.offset > 0 else "behind"
        size = f"{1e3 * abs(first.offset):.1f} ms {side} (+-{1e3 * first.offset_sigma:.1f})"
        yield f"its clock was {size}{drifted}; corrected"
    for jump in jumps:
        yield f"its clock jumped by {1e3 * jump.by_s:+.0f} ms after {seconds_into(timing, jump):.1f} s; corrected"
    if (sigma := timing.latest.offset_sigma) > _POORLY_KNOWN_S:
        left = [_UP_TO_SIGMAS * sigma * each for each in speed]
        size = ""
        if all(math.isfinite(each) for each in left):
            size = f": up to {1e3 * left[1]:.0f} mm and {math.degrees(left[0]):.1f} deg may be left"
        yield f"its clock is known to {1e3 * sigma:.0f} ms only, for it hardly moved{size}"


def _drifts(clock: ClockState) -> bool:
    return abs(clock.drift) > 2.0 * clock.drift_sigma
