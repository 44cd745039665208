"""What a person should know of the clocks and spans of a replay's cameras, a line each.

Clocks that are off by less than the recording are estimated from the motion, see ``bodycam_ros.timing``.
"""

import math
from collections.abc import Collection, Iterator, Mapping

import numpy as np

from bodycam_ros.timing.clock_state import ClockHistory, ClockState

_WORTH_SAYING_S = 0.003
"""A limb at 3 m/s is 1 cm further by then."""

_EXPECTED_SIGMAS = 3.0
"""Clocks that are off by less than this many of the sigmas expected of them are in the report alone."""

_POORLY_KNOWN_S = 0.004
_UP_TO_SIGMAS = 2.0


def clock_remarks(
    timings: Mapping[str, ClockHistory],
    speeds: Mapping[str, tuple[float, float]],
    expected_s: float = 0.0,
) -> tuple[str, ...]:
    """A line for every clock that was off by more than expected or was set, the worst first.

    One more is for those that stayed unknown.

    Args:
        timings: camera -> how its clock went.
        speeds: camera -> how fast it turned and moved [rad/s, m/s].
        expected_s: standard deviation of the clocks as the recording has them [s].
    """
    lines = []
    for camera, timing in sorted(timings.items(), key=lambda item: -abs(item[1].clocks[0].offset)):
        lines += [f"camera {camera}: {remark}" for remark in _of_camera(timing, expected_s)]
    poor = {camera: timing for camera, timing in timings.items() if timing.latest.offset_sigma > _POORLY_KNOWN_S}
    return (*lines, *_poorly_known(poor, speeds))


def _of_camera(timing: ClockHistory, expected_s: float) -> Iterator[str]:
    first = timing.clocks[0]
    if timing.is_off and abs(first.offset) > max(
        _WORTH_SAYING_S, _EXPECTED_SIGMAS * expected_s, 2.0 * first.offset_sigma
    ):
        drift = f", drift {1e6 * first.drift:+z.0f} ppm" if _drifts(first) else ""
        offset = f"{1e3 * first.offset:+z.1f} +- {1e3 * first.offset_sigma:.1f} ms"
        yield f"clock offset {offset}{drift}, corrected"
    for stamp_ns, by_s in timing.jumps:
        after_s = 1e-9 * (stamp_ns - first.since_ns)
        yield f"its clock jumped by {1e3 * by_s:+z.0f} ms after {after_s:.1f} s; corrected"


def _poorly_known(timings: Mapping[str, ClockHistory], speeds: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """One line for all cameras whose clocks stayed unknown, with the most that this may leave."""
    if not timings:
        return
    sigma_s = max(timing.latest.offset_sigma for timing in timings.values())
    left = [
        [_UP_TO_SIGMAS * timings[camera].latest.offset_sigma * each for each in speeds[camera]]
        for camera in timings
        if camera in speeds
    ]
    size = ""
    if left:
        turn, shift = np.max(left, axis=0).tolist()
        size = f": errors of up to {1e3 * shift:.0f} mm and {math.degrees(turn):.1f} deg may be left"
    one = len(timings) == 1
    whose = f"the clock of camera {next(iter(timings))} is" if one else f"the clocks of {len(timings)} cameras are"
    yield f"{whose} known to {1e3 * sigma_s:.0f} ms only, because {'it' if one else 'they'} hardly moved{size}"


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

    @property
    def known(self) -> dict[str, tuple[int, int]]:
        """Camera -> first and last stamp [ns], of those with an image."""
        return {camera: span for camera, span in self._spans_ns.items() if span is not None}

    def extend(self, later: Mapping[str, tuple[int, int]]) -> None:
        """Note the images of another stretch of the recording."""
        for camera, span in later.items():
            for stamp_ns in span:
                self.add(camera, stamp_ns)

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
