"""The history of a camera's clock as messages, bodycam_msgs/CameraTiming."""

import math
from collections.abc import Iterator

from bodycam_ros.camera.readout import readout_of
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.timing import SaidTiming, timing_message
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockState

TIMING, TIMING_TYPE = "/timing", "bodycam_msgs/msg/CameraTiming"
"""End and type of the topic."""


def timing_messages(make: MessageFactory, history: ClockHistory) -> Iterator[tuple[int, Message]]:
    """(stamp from which it holds [ns], message) of every clock that a camera had, as its body tells."""
    readout = readout_of(history.readout_time, history.readout_sigma)
    for clock in history.clocks:
        said = SaidTiming(
            clock.since_ns,
            "body",
            readout,
            1e-9 * clock.offset_ns(clock.since_ns),
            clock.offset_sigma,
            clock.drift,
            clock.drift_sigma,
        )
        yield clock.since_ns, timing_message(make, history.camera, said)


def says_clock(message: Message) -> bool:
    """Whether a message speaks of a clock at all, and not of rows alone."""
    return not math.isnan(message.offset_sigma)


def clock_state(message: Message) -> ClockState:
    """The clock that a message speaks of."""
    since_ns = stamp_ns(message.header.stamp)
    return ClockState(since_ns, since_ns, message.offset, message.drift, message.offset_sigma, message.drift_sigma)
