"""What a person should know of the clocks and spans of a replay's cameras, a line each.

Clocks that are off by less than the recording are estimated from the motion, see ``bodycam_ros.timing``.
"""

import math
from collections.abc import Collection, Iterator, Mapping

import numpy as np

from bodycam_ros.timing.clock_state import ClockHistory, ClockState

_WORTH_SAYING_S = 0.003
"""A limb at 3 m/s is 1 cm further by then."""

_POORLY_KNOWN_S = 0.004
_UP_TO_SIGMAS = 2.0


def clock_remarks(
    timings: Mapping[str, ClockHistory],
    speeds: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """A line for every clock that was off, was set, or stayed unknown.

    Args:
        timings: camera -> how its clock went.
        speeds: camera -> how fast it turned and moved [rad/s, m/s].
    """
    lines = []
    for camera, timing in sorted(timings.items()):
        speed = speeds.get(camera, (math.nan, math.nan))
        lines += [f"camera {camera}: {remark}" for remark in _of_camera(timing, speed)]
    return tuple(lines)


def _of_camera(timing: ClockHistory, speed: tuple[float, float]) -> Iterator[str]:
    first = timing.clocks[0]
    if timing.is_off and abs(first.offset) > max(_WORTH_SAYING_S, 2.0 * first.offset_sigma):
        drifted = f", and drifted by {1e6 * first.drift:+.0f} ppm" if _drifts(first) else ""
        side = "ahead" if first.offset > 0 else "behind"
        size = f"{1e3 * abs(first.offset):.1f} ms {side} (+-{1e3 * first.offset_sigma:.1f})"
        yield f"its clock was {size}{drifted}; corrected"
    for stamp_ns, by_s in timing.jumps:
        after_s = 1e-9 * (stamp_ns - first.since_ns)
        yield f"its clock jumped by {1e3 * by_s:+.0f} ms after {after_s:.1f} s; corrected"
    if (sigma := timing.latest.offset_sigma) > _POORLY_KNOWN_S:
        left = [_UP_TO_SIGMAS * sigma * each for each in speed]
        size = ""
        if all(math.isfinite(each) for each in left):
            size = f": up to {1e3 * left[1]:.0f} mm and {math.degrees(left[0]):.1f} deg may be left"
        yield f"its clock is known to {1e3 * sigma:.0f} ms only, for it hardly moved{size}"


def _drifts(clock: ClockState) -> bool:
    return abs(clock.drift) > 2.0 * clock.drift_sigma


class CameraSpans:
    """First and last stamps by camera.

    Args:
        cameras: that are expected to have images.
    """

    def __init__(self, cameras: Collection[str]) -> None:
        self._spans_ns: dict[str, tuple[int, int] | None] = dict.fromkeys(cameras)

    def add(self, camera: str, stamp_ns: int) -> None:
        """Note an image."""
        first, last = self._spans_ns[camera] or (stamp_ns, stamp_ns)
        self._spans_ns[camera] = min(first, stamp_ns), max(last, stamp_ns)

    def remarks(self) -> tuple[str, ...]:
        """A line for every camera without images, or with none at the time of the others."""
        lines = []
        for camera, own in self._spans_ns.items():
            others = [span for name, span in self._spans_ns.items() if span is not None and name != camera]
            if own is None:
                lines.append(f"camera {camera}: no image of it could be used")
            elif others and (own[0] > np.median([s[1] for s in others]) or own[1] < np.median([s[0] for s in others])):
                off_s = 1e-9 * (own[0] - float(np.median([span[0] for span in others])))
                side = "ahead of" if off_s > 0 else "behind"
                lines.append(f"camera {camera}: its stamps are {abs(off_s):.1f} s {side} the others'; set its clock")
        return tuple(lines)
