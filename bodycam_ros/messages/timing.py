"""Clock and read-out time of a camera (bodycam_msgs/CameraTiming)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.camera.readout import LONGEST_READOUT_S, Readout, readout_of
from bodycam_ros.messages.factory import Message, MessageFactory, header_message, stamp_ns
from bodycam_ros.timing.clock_state import ClockHistory, ClockState


@dataclass(frozen=True)
class CameraTiming:
    """Clock and read-out time of a camera; NaN where unknown.

    A time t of its stamps is the time ``t - offset - drift * (t - stamp)`` of the recording.

    Attributes:
        stamp_ns: first stamp for which it is valid, in the camera's own stamps [ns].
        source: sound, motion, given or body.
        readout: read-out time of the rows; None if it is unknown.
        offset: clock offset, positive if the stamps are ahead of the recording's time [s].
        offset_sigma: its standard deviation [s].
        drift: clock drift, growth of the offset [s/s].
        drift_sigma: its standard deviation [s/s].
    """

    stamp_ns: int
    source: str
    readout: Readout | None = None
    offset: float = 0.0
    offset_sigma: float = math.nan
    drift: float = 0.0
    drift_sigma: float = math.nan


def timing_message(make: MessageFactory, camera: str, timing: CameraTiming) -> Message:
    """bodycam_msgs/CameraTiming of a camera."""
    return make(
        "bodycam_msgs/msg/CameraTiming",
        header=header_message(make, timing.stamp_ns, make.frame(optical_frame(camera))),
        source=timing.source,
        offset=timing.offset,
        offset_sigma=timing.offset_sigma,
        drift=timing.drift,
        drift_sigma=timing.drift_sigma,
        readout_time=math.nan if timing.readout is None else timing.readout.seconds,
        readout_sigma=math.nan if timing.readout is None else timing.readout.sigma,
    )


def camera_timing(message: Message) -> CameraTiming:
    """Content of a bodycam_msgs/CameraTiming.

    Raises:
        ValueError: its read-out time is out of range.
    """
    readout = readout_of(message.readout_time, message.readout_sigma)
    if readout is not None and not (abs(readout.seconds) <= LONGEST_READOUT_S and 0.0 <= readout.sigma < math.inf):
        raise ValueError(
            f"a read-out time of {readout.seconds:g} s, give or take {readout.sigma:g} s; expected at most "
            f"{LONGEST_READOUT_S:g} s, and a standard deviation of 0 (given) or more"
        )
    return CameraTiming(
        stamp_ns=stamp_ns(message.header.stamp),
        source=message.source,
        readout=readout,
        offset=message.offset,
        offset_sigma=message.offset_sigma,
        drift=message.drift,
        drift_sigma=message.drift_sigma,
    )


TIMING, TIMING_TYPE = "/timing", "bodycam_msgs/msg/CameraTiming"
"""End and type of the topic."""


def timing_messages(make: MessageFactory, history: ClockHistory) -> Iterator[tuple[int, Message]]:
    """(first stamp for which it is valid [ns], message) of every clock state of a camera."""
    readout = readout_of(history.readout_time, history.readout_sigma)
    for clock in history.clocks:
        timing = CameraTiming(
            clock.since_ns,
            "body",
            readout,
            1e-9 * clock.offset_ns(clock.since_ns),
            clock.offset_sigma,
            clock.drift,
            clock.drift_sigma,
        )
        yield clock.since_ns, timing_message(make, history.camera, timing)


def clock_state(message: Message) -> ClockState:
    """Clock state of a message; one without a clock, with the read-out time alone, has NaN sigmas."""
    since_ns = stamp_ns(message.header.stamp)
    return ClockState(since_ns, since_ns, message.offset, message.drift, message.offset_sigma, message.drift_sigma)
