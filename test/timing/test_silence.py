"""A silence of all cameras, by the stamps of inertial sensors: images on their way, and bursts, are none."""

from bodycam_ros.timing.silence import Silence

MS = 1_000_000
PERIOD_NS = 33 * MS
START_NS = 10**12


class Clock:
    """A steady clock that a test sets."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


def run(
    silence: Silence, clock: Clock, until_ms: int, delay_ms: int, gone: range = range(0), since_ms: int = 0
) -> None:
    """Samples every 5 ms; images every 33 ms, whose registrations come later by a delay."""
    for ms in range(since_ms, until_ms):
        clock.seconds = 1e-3 * ms
        if (ms - delay_ms) % 33 == 0 and ms - delay_ms not in gone:
            silence.add_message(START_NS + (ms - delay_ms) * MS)
        if ms % 5 == 0:
            silence.add_sample(START_NS + ms * MS)
            if not gone or ms - delay_ms < gone.start:
                assert silence.due_ns(PERIOD_NS) is None, ms


def test_images_that_are_slow_on_their_way_are_no_silence() -> None:
    for delay_ms in (10, 200, 900):
        run(Silence(clock := Clock()), clock, 3000, delay_ms)


def test_states_are_due_as_late_as_with_images() -> None:
    silence = Silence(clock := Clock())
    run(silence, clock, 2500, 40, range(2000, 3000))
    due_ns = silence.due_ns(PERIOD_NS)
    # The latest sample is of 2.495 s; registrations took up to 0.045 s of it.
    assert due_ns is not None and 2.39e9 < due_ns - START_NS < 2.43e9
    silence.add_message(START_NS + 2500 * MS)
    assert silence.due_ns(PERIOD_NS) is None


def test_images_that_are_taken_are_waited_for_though_their_registrations_stall() -> None:
    for stall_ms, is_silent in ((400, False), (900, True)):
        silence = Silence(clock := Clock())
        run(silence, clock, 2000, 40)
        for ms in range(2000, 2000 + stall_ms, 5):
            clock.seconds = 1e-3 * ms
            silence.add_image(START_NS + ms * MS)
            silence.add_sample(START_NS + ms * MS)
        assert (silence.due_ns(PERIOD_NS) is not None) == is_silent, stall_ms


def test_samples_that_come_in_a_burst_before_the_registrations_are_no_silence() -> None:
    silence = Silence(clock := Clock())
    run(silence, clock, 1000, 40)
    clock.seconds += 2.0  # the process stood still
    for ms in range(1000, 3000, 5):
        clock.seconds += 1e-5
        silence.add_sample(START_NS + ms * MS)
        assert silence.due_ns(PERIOD_NS) is None
