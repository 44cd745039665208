"""Clock and read-out time of a camera (bodycam_msgs/CameraTiming); NaN where unknown.

A time t of its stamps is the time ``t - offset - drift * (t - stamp)`` of the recording.
"""

import math
from collections.abc import Iterator

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.camera.readout import LONGEST_READOUT_S, Readout, readout_of
from bodycam_ros.messages.factory import Message, MessageFactory, header_message, stamp_ns
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

TIMING, TIMING_TYPE = "/timing", "bodycam_msgs/msg/CameraTiming"
"""End and type of the topic."""


UNKNOWN_CLOCK = ClockState(0, 0, 0.0, 0.0, math.nan, math.nan)


def timing_message(
    make: MessageFactory, camera: str, source: str, readout: Readout | None, clock: ClockState = UNKNOWN_CLOCK
) -> Message:
    """bodycam_msgs/CameraTiming of a camera.

    Args:
        source: sound, motion, given or body.
        readout: read-out time of the rows; None if it is unknown.
        clock: from its first stamp on; not given if it is unknown.
    """
    return make(
        TIMING_TYPE,
        header=header_message(make, clock.since_ns, make.frame(optical_frame(camera))),
        source=source,
        offset=1e-9 * clock.offset_ns(clock.since_ns),
        offset_sigma=clock.offset_sigma,
        drift=clock.drift,
        drift_sigma=clock.drift_sigma,
        readout_time=math.nan if readout is None else readout.seconds,
        readout_sigma=math.nan if readout is None else readout.sigma,
    )


def timing_messages(make: MessageFactory, history: ClockHistory) -> Iterator[tuple[int, Message]]:
    """(first stamp for which it is valid [ns], message) of every clock state of a camera."""
    for clock in history.clocks:
        yield clock.since_ns, timing_message(make, history.camera, "body", history.readout, clock)


def readout_time(message: Message) -> Readout | None:
    """Read-out time of a bodycam_msgs/CameraTiming; None if it is unknown.

    Raises:
        ValueError: it is out of range.
    """
    readout = readout_of(message.readout_time, message.readout_sigma)
    if readout is not None and not (abs(readout.seconds) <= LONGEST_READOUT_S and 0.0 <= readout.sigma < math.inf):
        raise ValueError(
            f"a read-out time of {readout.seconds:g} s, give or take {readout.sigma:g} s; expected at most "
            f"{LONGEST_READOUT_S:g} s, and a standard deviation of 0 (given) or more"
        )
    return readout


def clock_state(message: Message) -> ClockState:
    """Clock state of a bodycam_msgs/CameraTiming."""
    since_ns = stamp_ns(message.header.stamp)
    return ClockState(since_ns, since_ns, message.offset, message.drift, message.offset_sigma, message.drift_sigma)
