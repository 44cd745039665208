"""The filter of clocks by itself."""

import numpy as np

from bodycam_ros.timing.clock_evidence import ClockEvidence
from bodycam_ros.timing.clock_filter import ClockFilter


def test_drifts_are_no_better_known_when_a_long_recording_is_played_again() -> None:
    clocks = ClockFilter(0.1)
    for camera in "abcd":
        clocks.add_camera(camera, triggered=False)
    for _ in range(900):
        clocks.advance(4.0)
        assert not clocks.update(lambda *_: ClockEvidence((np.eye(4) - 0.25) / 0.0015**2, np.zeros(4), np.ones(4)))
    before = clocks.sigmas[1]
    clocks.advance(-3600.0)
    assert (clocks.sigmas[1][1:] > before[1:]).all()
