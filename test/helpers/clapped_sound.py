"""Sound of cameras that recorded the same claps, made so that every start and drift is known."""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import av
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from bodycam_ros.recording.sound import SoundBlock, SoundSource


@dataclass(frozen=True)
class Recorder:
    """A camera: its media time is ``(true - start_s) / (1 + drift)``, and it runs until ``end_s`` of true time.

    Echoes are (delay [s], share) of all that it hears; ``own`` are knocks that nobody else hears [s].
    """

    start_s: float
    end_s: float
    drift: float = 0.0
    way_m: float = 0.0
    gain: float = 1.0
    noise: float = 0.005
    rate_hz: int = 48000
    muffled_hz: float = 0.0
    clip: float = np.inf
    echoes: tuple[tuple[float, float], ...] = ()
    deaf_to: tuple[float, ...] = ()
    own: tuple[float, ...] = field(default=())


def clap_waveform(seed: int, rate_hz: float) -> NDArray[np.float64]:
    """Noise with a sudden beginning that dies away within 60 ms, at 8 times the rate of a camera."""
    random = np.random.default_rng(seed)
    seconds = np.arange(int(0.25 * rate_hz)) / rate_hz
    noise = sosfilt(butter(2, (400.0, 9000.0), "bandpass", fs=rate_hz, output="sos"), random.normal(size=len(seconds)))
    waveform = noise * np.exp(-seconds / 0.012)
    return waveform / np.abs(waveform).max()


def sound_of(
    recorder: Recorder, claps: Mapping[float, float], seed: int, background: NDArray[np.float64] | None = None
) -> NDArray[np.float32]:
    """Samples of a recorder that hears claps (true time [s] -> loudness) 3 ms a metre late.

    A background, at 2 kHz from true time 0 on, is a loudness that a common noise follows.
    """
    random = np.random.default_rng(seed)
    count = int((recorder.end_s - recorder.start_s) / (1.0 + recorder.drift) * recorder.rate_hz)
    samples = recorder.noise * random.normal(size=count)
    fine = 8 * 48000
    for time, loudness in [*claps.items(), *((time, 0.3) for time in recorder.own)]:
        if time in recorder.deaf_to:
            continue
        private = seed + 1000 if time in recorder.own else 0
        waveform = clap_waveform(int(1000 * time) + private, fine)
        heard = (time + recorder.way_m / 343.0 - recorder.start_s) / (1.0 + recorder.drift) * recorder.rate_hz
        first = int(np.ceil(heard))
        places = np.arange(first, first + int(0.24 * recorder.rate_hz))
        at = (places - heard) / recorder.rate_hz * (1.0 + recorder.drift) * fine
        there = (places >= 0) & (places < count)
        samples[places[there]] += loudness * np.interp(at[there], np.arange(len(waveform)), waveform)
    if background is not None:
        true_s = (
            recorder.start_s + (1.0 + recorder.drift) * np.arange(count) / recorder.rate_hz - recorder.way_m / 343.0
        )
        samples += np.interp(true_s * 2000.0, np.arange(len(background)), background) * random.normal(size=count)
    straight = samples.copy()
    for delay_s, share in recorder.echoes:
        late = int(delay_s * recorder.rate_hz)
        samples[late:] += share * straight[:-late]
    if recorder.muffled_hz:
        samples = sosfilt(butter(4, recorder.muffled_hz, fs=recorder.rate_hz, output="sos"), samples)
    samples *= recorder.gain
    return np.clip(samples, -recorder.clip, recorder.clip).astype(np.float32)


def source(samples: NDArray[np.float32], rate_hz: float, block: int = 1024, start_s: float = 0.0) -> SoundSource:
    """Samples as blocks of the size that AAC has."""

    def blocks() -> Iterator[SoundBlock]:
        for first in range(0, len(samples), block):
            yield SoundBlock(start_s + first / rate_hz, samples[first : first + block], rate_hz)

    return blocks


def through_aac(samples: NDArray[np.float32], rate_hz: int, bit_rate: int = 96_000) -> SoundSource:
    """Samples written as AAC in MP4 and read back, with the stamps that the file gives."""
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("aac", rate=rate_hz, layout="mono", bit_rate=bit_rate)
        for first in range(0, len(samples), 1024):
            frame = av.AudioFrame.from_ndarray(samples[None, first : first + 1024], format="fltp", layout="mono")
            frame.sample_rate, frame.pts = rate_hz, first
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    content = file.getvalue()

    def blocks() -> Iterator[SoundBlock]:
        with av.open(io.BytesIO(content)) as container:
            for frame in container.decode(audio=0):
                assert frame.pts is not None and frame.time_base is not None
                yield SoundBlock(float(frame.pts * frame.time_base), frame.to_ndarray()[0], frame.sample_rate)

    return blocks


def sources(
    recorders: Mapping[str, Recorder],
    claps: Mapping[float, float],
    aac: bool = False,
    background: NDArray[np.float64] | None = None,
) -> dict[str, SoundSource]:
    """Camera -> its sound."""
    made = {}
    for seed, (name, recorder) in enumerate(recorders.items()):
        samples = sound_of(recorder, claps, seed, background)
        made[name] = through_aac(samples, recorder.rate_hz) if aac else source(samples, recorder.rate_hz)
    return made


def true_start(recorders: Mapping[str, Recorder], camera: str, reference: str) -> float:
    """``CameraTime.start_s`` as it should be [s]."""
    return (recorders[camera].start_s - recorders[reference].start_s) / (1.0 + recorders[reference].drift)


def true_drift(recorders: Mapping[str, Recorder], camera: str, reference: str) -> float:
    """``CameraTime.drift`` as it should be."""
    return (1.0 + recorders[camera].drift) / (1.0 + recorders[reference].drift) - 1.0


def worst_errors(
    recorders: Mapping[str, Recorder], reference: str, times: Mapping[str, object], names: Sequence[str] | None = None
) -> tuple[float, float]:
    """(worst error of a start [s], of a drift)."""
    starts, drifts = [], []
    for name in names or list(times):
        time = times[name]
        starts.append(abs(time.start_s - true_start(recorders, name, reference)))
        drifts.append(abs(time.drift - true_drift(recorders, name, reference)))
    return max(starts), max(drifts)
