import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from helpers.clapped_sound import Recorder, sound_of, source

from bodycam_ros.ingest.sound_envelope import ENVELOPE_S, CameraSound, scan_sound
from bodycam_ros.recording.sound import SoundBlock


def loud_s(sound: CameraSound) -> list[float]:
    """Media times at which it gets louder by far [s]."""
    steps = np.flatnonzero(sound.envelope > 0.6 * sound.envelope.max())
    first = steps[np.diff(steps, prepend=-1000) > 25]
    return (sound.start_s + ENVELOPE_S * first).tolist()


@pytest.mark.parametrize("rate_hz", [16000, 44100, 48000, 96000])
def test_it_gets_louder_where_a_clap_begins(rate_hz: int) -> None:
    samples = sound_of(Recorder(0.0, 8.0, rate_hz=rate_hz), {2.345: 0.8, 6.1: 0.7}, seed=1)
    sound = scan_sound(source(samples, rate_hz)())
    assert loud_s(sound) == pytest.approx([2.345, 6.1], abs=0.005)
    assert sound.duration_s == pytest.approx(8.0)
    assert len(sound.envelope) == pytest.approx(8.0 / ENVELOPE_S, abs=2)


def test_the_size_of_blocks_does_not_matter() -> None:
    samples = sound_of(Recorder(0.0, 25.0), {2.0: 0.8, 9.99: 0.5, 10.07: 0.5, 20.001: 0.5}, seed=2)
    small = scan_sound(source(samples, 48000, block=137)())
    large = scan_sound(source(samples, 48000, block=480_000)())
    assert np.array_equal(small.envelope, large.envelope)


def test_a_gap_in_the_sound_is_kept() -> None:
    samples = sound_of(Recorder(0.0, 4.0), {2.0: 0.8}, seed=4)

    def blocks() -> Iterator[SoundBlock]:
        yield from source(samples, 48000)()
        yield from source(samples, 48000, start_s=10.0)()

    sound = scan_sound(blocks())
    assert loud_s(sound) == pytest.approx([2.0, 12.0], abs=0.005)
    assert sound.duration_s == pytest.approx(14.0, abs=0.01)
    assert not sound.envelope[int(4.5 / ENVELOPE_S) : int(9.5 / ENVELOPE_S)].any()


def test_no_sound_silence_and_not_a_number() -> None:
    assert scan_sound(iter(())).duration_s == 0.0
    silence = scan_sound(source(np.zeros(48000, np.float32), 48000)())
    assert silence.loudest == 0.0 and not silence.envelope.any()
    assert not scan_sound(source(np.full(48000, np.nan, np.float32), 48000)()).envelope.any()


def test_a_long_sound_takes_bounded_memory() -> None:
    minute = sound_of(Recorder(0.0, 60.0), {1.0 + 0.5 * n: 0.5 for n in range(110)}, seed=5)

    def blocks() -> Iterator[SoundBlock]:
        for number in range(10):
            yield from source(minute, 48000, block=4096, start_s=60.0 * number)()

    tracemalloc.start()
    scan_sound(blocks())
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 60e6  # ten minutes of samples alone are 115 MB
