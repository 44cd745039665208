"""Sudden sounds of one camera: when, how loud, how sharp, and their waveform; and how loud it gets (A section 3).

A sound of any length goes through in chunks; what is kept of it grows by some kilobytes a second at most.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, resample, sosfilt

from bodycam_ros.recording.sound import SoundBlock

Array = NDArray[np.float64]

SNIPPET_S, BEFORE_S = 0.06, 0.015
"""How much of the waveform of a peak is kept, and how much of that lies before it."""

SNIPPET_SAMPLES = 1440
"""A snippet has 24 kHz whatever the camera's rate: a clap has little above 12 kHz, and a phone's AAC nothing."""

ENVELOPE_S = 0.002
"""Step of the envelope that the sound as a whole is compared by."""

CHUNK_S, MOST_PEAKS = 10.0, 8
"""Sounds compete for a place within this long; a dribbled ball, each bounce a peak, must not fill the memory."""

_FRAME_S = 0.001
_STEP = round(ENVELOPE_S / _FRAME_S)
_CONTEXT_S = 0.2  # on both sides of a chunk: filters settle, and a rise and its snippet need it
_BANDS_HZ = ((300.0, 1500.0), (1500.0, 5000.0), (5000.0, 12000.0))  # wind lies beneath; AAC may drop what is above
_MOST_OF_NYQUIST = 0.95
_MIN_RISE_DB = 9.0  # over the milliseconds before; steady noise rises by up to 4.4 in a minute, bumps by 9 to 13
_MIN_GAP_S = 0.05  # of two nearer peaks the weaker is an echo
_AFTER, _GAP, _BEFORE = 4, 6, 8  # frames; the gap steps over the pre-echo of AAC
_LEAST_ENERGY = 1e-10  # -100 dB of full scale: what is below is digital silence
_LARGEST_RISE_DB = 60.0
_LOUD_DB = 30.0  # rise of a clap at arm's length; louder is not worth more
_RATE_TOLERANCE_S = 0.02


@dataclass(frozen=True, eq=False)
class SoundPeak:
    """A sudden sound.

    Attributes:
        media_s: when it begins, to a millisecond [s].
        rise_db: by how much it is louder than what was before, in the two bands that rise most [dB].
        sharpness: 1 if the whole rise takes no longer than a few milliseconds, 0 if it is slow.
        amplitude: of its largest sample; full scale is 1.
        snippet: (1440,) float16 waveform of 60 ms from 15 ms before ``snippet_s`` on, its largest value 1.
        snippet_s: media time of the snippet's first sample [s].
    """

    media_s: float
    rise_db: float
    sharpness: float
    amplitude: float
    snippet: NDArray[np.float16]
    snippet_s: float

    @property
    def weight(self) -> float:
        """How clearly it is a sudden sound, 0 to 1."""
        return float(np.clip(self.rise_db / _LOUD_DB, 0.0, 1.0) ** 2) * self.sharpness


@dataclass(frozen=True, eq=False)
class CameraSound:
    """What is kept of a camera's sound.

    Attributes:
        start_s: media time of the first sample [s]; 0 without sound.
        end_s: media time of the end of the last [s]; 0 without sound.
        loudest: largest sample by magnitude; 0: silence, or no sound at all.
        peaks: in order of time.
        envelope: (N,) float16 how much louder it gets, by steps of ``ENVELOPE_S`` from ``start_s`` on; zero in gaps.
    """

    start_s: float
    end_s: float
    loudest: float
    peaks: tuple[SoundPeak, ...]
    envelope: NDArray[np.float16]

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return self.end_s - self.start_s


def scan_sound(blocks: Iterable[SoundBlock]) -> CameraSound:
    """What is kept of a camera's sound, which is read once from its beginning to its end."""
    peaks: list[SoundPeak] = []
    envelopes: list[tuple[float, NDArray[np.float16]]] = []
    end_s, loudest = 0.0, 0.0
    for chunk in _chunks(blocks):
        loudest = max(loudest, float(np.abs(chunk.samples).max()))
        energies = _band_energies(chunk)
        begin, end = (round(1e3 * seconds) for seconds in (chunk.begin_s, chunk.end_s))
        flux = _flux(energies)[begin:end]
        even = flux[: len(flux) - len(flux) % _STEP].reshape(-1, _STEP).max(axis=1)
        envelopes.append((chunk.start_s + chunk.begin_s, even.astype(np.float16)))
        strongest = sorted(_peaks(chunk, energies, begin, end), key=lambda peak: -peak.rise_db)[:MOST_PEAKS]
        peaks += sorted(strongest, key=lambda peak: peak.media_s)
        end_s = max(end_s, chunk.start_s + chunk.end_s)
    if not envelopes:
        return CameraSound(0.0, 0.0, 0.0, (), np.zeros(0, dtype=np.float16))
    start_s = envelopes[0][0]
    places = [max(0, round((part_s - start_s) / ENVELOPE_S)) for part_s, _ in envelopes]
    envelope = np.zeros(max(k + len(part) for k, (_, part) in zip(places, envelopes, strict=True)), np.float16)
    for place, (_, part) in zip(places, envelopes, strict=True):
        envelope[place : place + len(part)] = part
    return CameraSound(start_s, end_s, loudest, tuple(peaks), envelope)


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Samples (N,) without a gap, with context on both sides of what is new in it.

    ``start_s`` is the media time of the first sample; ``begin_s`` to ``end_s`` [s] after it is what is new.
    """

    samples: NDArray[np.float32]
    rate_hz: float
    start_s: float
    begin_s: float
    end_s: float


def _chunks(blocks: Iterable[SoundBlock]) -> Iterator[_Chunk]:
    """Chunks of 10 s, the last of each run without a gap longer or shorter; the same whatever the size of blocks."""
    buffered = np.zeros(0, np.float32)
    rate_hz, start_s, begin_s = 0.0, 0.0, 0.0
    for block in blocks:
        if not len(block.samples):
            continue
        late_s = block.start_s - start_s - len(buffered) / max(rate_hz, 1.0)
        if len(buffered) and (block.rate_hz != rate_hz or abs(late_s) > _RATE_TOLERANCE_S):
            yield _Chunk(buffered, rate_hz, start_s, begin_s, len(buffered) / rate_hz)
            buffered = buffered[:0]
        if not len(buffered):
            rate_hz, start_s, begin_s = block.rate_hz, block.start_s, 0.0
        buffered = np.concatenate((buffered, np.nan_to_num(np.asarray(block.samples, dtype=np.float32))))
        while len(buffered) >= round((begin_s + CHUNK_S + _CONTEXT_S) * rate_hz):
            size, passed = (
                round((begin_s + CHUNK_S + _CONTEXT_S) * rate_hz),
                round((begin_s + CHUNK_S - _CONTEXT_S) * rate_hz),
            )
            yield _Chunk(buffered[:size], rate_hz, start_s, begin_s, begin_s + CHUNK_S)
            # Stamps are rounded, and clocks of sound drift against those of images: each chunk follows the stamps.
            start_s, begin_s = start_s + passed / rate_hz, _CONTEXT_S
            buffered = buffered[passed:]
    if len(buffered):
        yield _Chunk(buffered, rate_hz, start_s, begin_s, len(buffered) / rate_hz)


def _band_energies(chunk: _Chunk) -> Array:
    """Mean squares (3, K) of frames of a millisecond; bands above half of the rate are silent."""
    frames = int(len(chunk.samples) / (_FRAME_S * chunk.rate_hz))
    edges = np.ceil(np.arange(frames + 1) * _FRAME_S * chunk.rate_hz - 1e-6).astype(int)
    energies = np.zeros((len(_BANDS_HZ), frames))
    for band, (low, high) in enumerate(_BANDS_HZ):
        highest = min(high, _MOST_OF_NYQUIST * chunk.rate_hz / 2.0)
        if low < highest and frames:
            sos = butter(2, (low, highest), "bandpass", fs=chunk.rate_hz, output="sos")
            squares = sosfilt(sos, chunk.samples[: edges[-1]]) ** 2
            energies[band] = np.add.reduceat(squares, edges[:-1]) / np.diff(edges)
    return energies


def _peaks(chunk: _Chunk, energies: Array, begin: int, end: int) -> Iterator[SoundPeak]:
    """Peaks of the frames from ``begin`` to before ``end``."""
    reach = round(0.5 * _MIN_GAP_S / _FRAME_S)
    strength = np.sort(_rises(energies), axis=0)[-2:].mean(axis=0)
    highest = (strength >= maximum_filter1d(strength, 2 * reach + 1)) & (strength >= _MIN_RISE_DB)
    last = -reach
    for frame in (np.flatnonzero(highest[begin:end]) + begin).tolist():
        if frame - last < reach:  # of equals the first
            continue
        last = frame
        around = energies[:, max(0, frame - 3) : frame + 6].sum(axis=0)
        middle = max(0, frame - 3) + int(np.argmax(np.diff(around, prepend=around[0])))
        first = round((middle * _FRAME_S - BEFORE_S) * chunk.rate_hz)
        cut = np.zeros(round(SNIPPET_S * chunk.rate_hz))
        low, high = max(first, 0), min(first + len(cut), len(chunk.samples))
        cut[low - first : high - first] = chunk.samples[low:high]
        waveform = resample(cut, SNIPPET_SAMPLES)
        largest = float(np.abs(waveform).max())
        yield SoundPeak(
            chunk.start_s + middle * _FRAME_S,
            float(strength[frame]),
            _sharpness(energies, middle),
            largest,
            (waveform / max(largest, 1e-12)).astype(np.float16),
            chunk.start_s + first / chunk.rate_hz,
        )


def _mean_over(energies: Array, first: int, last: int) -> Array:
    """Means (B, K) over the frames k + first to k + last; what lies outside repeats the outermost."""
    reach = max(abs(first), abs(last)) + 1
    padded = np.pad(energies, ((0, 0), (reach, reach)), mode="edge")
    sums = np.cumsum(np.pad(padded, ((0, 0), (1, 0))), axis=1)
    count = energies.shape[1]
    total = sums[:, reach + last + 1 : reach + last + 1 + count] - sums[:, reach + first : reach + first + count]
    return np.maximum(total / (last - first + 1), 0.0)


def _rises(energies: Array) -> Array:
    """By how many dB (B, K) each band is louder in the next milliseconds than in those before."""
    floor = np.maximum(np.median(energies, axis=1, keepdims=True), _LEAST_ENERGY)
    after = _mean_over(energies, 0, _AFTER - 1)
    before = np.maximum(_mean_over(energies, -_GAP - _BEFORE, -_GAP - 1), floor)
    rises: Array = np.clip(10.0 * np.log10(np.maximum(after / before, 1e-6)), 0.0, _LARGEST_RISE_DB)
    return rises


def _flux(energies: Array) -> Array:
    """How much louder (K,) it gets, all bands together, in no unit; a camera's gain takes no part."""
    floor = np.maximum(np.median(energies, axis=1, keepdims=True), _LEAST_ENERGY)
    louder = np.log1p(_mean_over(energies, 0, 3) / floor) - np.log1p(_mean_over(energies, -8, -1) / floor)
    flux: Array = np.clip(louder, 0.0, None).sum(axis=0)
    return flux


def _sharpness(energies: Array, frame: int) -> float:
    """Share of the energy around a rise, 30 ms before to 10 ms after, that comes after it."""
    total = energies.sum(axis=0)
    before = float(total[max(0, frame - 30) : frame - 3].sum()) * 10.0 / 27.0 if frame > 3 else 0.0
    after = float(total[max(0, frame - 1) : frame + 9].sum())
    return max(0.0, 1.0 - before / after) if after > 0.0 else 0.0
