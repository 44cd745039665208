"""bodycam_msgs/CameraTiming: what is known of a camera's clock and rows, on the wire."""

from collections.abc import Iterator

from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import header_message, optical_frame, stamp_ns
from bodycam_ros.timing.clock_history import ClockHistory
from bodycam_ros.timing.clock_state import ClockState

TIMING, TIMING_TYPE = "/timing", "bodycam_msgs/msg/CameraTiming"
"""End and type of the topic."""

_SOURCE = "body"


def timing_messages(make: MessageFactory, timing: ClockHistory) -> Iterator[tuple[int, Message]]:
    """(stamp from which it holds [ns], message) of every clock that a camera had."""
    for clock in timing.clocks:
        yield (
            clock.since_ns,
            make(
                TIMING_TYPE,
                header=header_message(make, clock.since_ns, optical_frame(timing.camera)),
                source=_SOURCE,
                offset=1e-9 * clock.offset_ns(clock.since_ns),
                offset_sigma=clock.offset_sigma,
                drift=clock.drift,
                drift_sigma=clock.drift_sigma,
                readout_time=timing.readout_time,
                readout_sigma=timing.readout_sigma,
            ),
        )


def clock_state(message: Message) -> ClockState:
    """The clock that a message speaks of."""
    since_ns = stamp_ns(message.header.stamp)
    return ClockState(since_ns, since_ns, message.offset, message.drift, message.offset_sigma, message.drift_sigma)
