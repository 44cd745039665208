"""A camera's clock over a recording: its stamps corrected, and on the wire."""

import numpy as np

from bodycam_ros.camera.readout import Readout
from bodycam_ros.messages.timing import clock_state, timing_messages
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.timing.clock_state import ClockHistory, ClockState

START_NS = 1_700_000_000_000_000_000
SET_NS = START_NS + 10_000_000_000
TIMING = ClockHistory(
    "toe",
    (
        ClockState(START_NS, START_NS + 5_000_000_000, 0.02, 1e-4, 0.001, 1e-5),
        ClockState(SET_NS, SET_NS, -0.03, 1e-4, 0.001, 1e-5),
    ),
    Readout(0.012, 0.0002),
)


def test_stamps_are_corrected_by_the_clock_that_held_then() -> None:
    seconds = np.array([-1.0, 0.0, 5.0, 9.0, 10.0, 20.0])
    stamps_ns = START_NS + np.round(1e9 * seconds).astype(np.int64)
    ahead_s = np.array([0.0194, 0.0195, 0.02, 0.0204, -0.03, -0.029])
    off_ns = stamps_ns - TIMING.corrected_ns(stamps_ns)
    assert np.abs(off_ns - 1e9 * ahead_s).max() <= 1


def test_what_is_read_from_the_wire_corrects_alike() -> None:
    messages = list(timing_messages(recorded_messages(), TIMING))
    assert [since_ns for since_ns, _ in messages] == [START_NS, SET_NS]
    assert {(m.header.frame_id, m.source) for _, m in messages} == {("toe_optical_frame", "body")}
    assert messages[0][1].readout_time == 0.012
    read = ClockHistory("toe", tuple(clock_state(message) for _, message in messages))
    stamps_ns = START_NS + 333_333_333 * np.arange(60, dtype=np.int64)
    assert np.abs(read.corrected_ns(stamps_ns) - TIMING.corrected_ns(stamps_ns)).max() <= 1
