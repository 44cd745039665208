import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from clapped_sound import Recorder, sound_of, source

from bodycam_ros.ingest.sound_peaks import CHUNK_S, ENVELOPE_S, MOST_PEAKS, scan_sound
from bodycam_ros.recording.sound import SoundBlock


@pytest.mark.parametrize("rate_hz", [16000, 44100, 48000, 96000])
def test_a_clap_is_found_where_it_begins(rate_hz: int) -> None:
    samples = sound_of(Recorder(0.0, 8.0, rate_hz=rate_hz), {2.345: 0.8, 6.1: 0.7}, seed=1)
    sound = scan_sound(source(samples, rate_hz)())
    assert [peak.media_s for peak in sound.peaks] == pytest.approx([2.345, 6.1], abs=0.002)
    assert all(peak.rise_db > 25.0 and peak.sharpness > 0.9 for peak in sound.peaks)
    assert sound.duration_s == pytest.approx(8.0)
    assert len(sound.envelope) == pytest.approx(8.0 / ENVELOPE_S, abs=2)


def test_the_size_of_blocks_does_not_matter() -> None:
    samples = sound_of(Recorder(0.0, 25.0), {2.0: 0.8, 9.99: 0.5, 10.07: 0.5, 20.001: 0.5}, seed=2)
    small = scan_sound(source(samples, 48000, block=137)())
    large = scan_sound(source(samples, 48000, block=480_000)())
    times = [peak.media_s for peak in small.peaks]
    assert times == pytest.approx([2.0, 9.99, 10.07, 20.001], abs=0.005)
    assert times == pytest.approx([peak.media_s for peak in large.peaks], abs=1e-9)


def test_wind_and_steady_noise_are_no_peaks() -> None:
    random = np.random.default_rng(3)
    gusts = np.interp(np.arange(20 * 48000) / 48000, np.arange(41) / 2.0, random.uniform(0.0, 0.3, 41))
    rumble = np.convolve(random.normal(size=20 * 48000), np.full(600, 1.0 / 25.0), "same")
    samples = (gusts * rumble + 0.01 * random.normal(size=20 * 48000)).astype(np.float32)
    assert not scan_sound(source(samples, 48000)()).peaks


def test_a_gap_in_the_sound_is_kept_and_is_no_peak() -> None:
    samples = sound_of(Recorder(0.0, 4.0), {2.0: 0.8}, seed=4)

    def blocks() -> Iterator[SoundBlock]:
        yield from source(samples, 48000)()
        yield from source(samples, 48000, start_s=10.0)()

    sound = scan_sound(blocks())
    assert [peak.media_s for peak in sound.peaks] == pytest.approx([2.0, 12.0], abs=0.002)
    assert sound.duration_s == pytest.approx(14.0, abs=0.01)
    assert not sound.envelope[int(4.5 / ENVELOPE_S) : int(9.5 / ENVELOPE_S)].any()


def test_no_sound_silence_and_not_a_number() -> None:
    assert scan_sound(iter(())).duration_s == 0.0
    silence = scan_sound(source(np.zeros(48000, np.float32), 48000)())
    assert silence.loudest == 0.0 and not silence.peaks and not silence.envelope.any()
    broken = scan_sound(source(np.full(48000, np.nan, np.float32), 48000)())
    assert not broken.peaks


def test_a_long_sound_takes_bounded_memory() -> None:
    minute = sound_of(Recorder(0.0, 60.0), {1.0 + 0.5 * n: 0.5 for n in range(110)}, seed=5)

    def blocks() -> Iterator[SoundBlock]:
        for number in range(10):
            yield from source(minute, 48000, block=4096, start_s=60.0 * number)()

    tracemalloc.start()
    sound = scan_sound(blocks())
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(sound.peaks) <= MOST_PEAKS * (600 / CHUNK_S + 1)
    assert peak_bytes < 60e6  # ten minutes of samples alone are 115 MB
