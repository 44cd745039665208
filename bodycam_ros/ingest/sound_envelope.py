"""How suddenly it gets louder in the sound of one camera, by which cameras that recorded the same are compared.

A sound of any length goes through in chunks; what is kept of it is a kilobyte a second.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfilt

from bodycam_ros.recording.sound import SoundBlock

Array = NDArray[np.float64]

ENVELOPE_S = 0.002
"""Step of the envelope."""

_CHUNK_S = 10.0
_FRAME_S = 0.001
_STEP = round(ENVELOPE_S / _FRAME_S)
_CONTEXT_S = 0.2  # on both sides of a chunk: filters settle
_BANDS_HZ = ((300.0, 1500.0), (1500.0, 5000.0), (5000.0, 12000.0))  # wind lies beneath; AAC may drop what is above
_MOST_OF_NYQUIST = 0.95
_AFTER, _BEFORE = 4, 8  # frames whose mean energies are compared
_LEAST_ENERGY = 1e-10  # -100 dB of full scale: what is below is digital silence
_RATE_TOLERANCE_S = 0.02


@dataclass(frozen=True, eq=False)
class CameraSound:
    """What is kept of a camera's sound.

    Attributes:
        start_s: media time of the first sample [s]; 0 without sound.
        end_s: media time of the end of the last [s]; 0 without sound.
        loudest: largest sample by magnitude; 0: silence, or no sound at all.
        envelope: (N,) float16 how much louder it gets, by steps of ``ENVELOPE_S`` from ``start_s`` on; zero in gaps.
    """

    start_s: float
    end_s: float
    loudest: float
    envelope: NDArray[np.float16]

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return self.end_s - self.start_s


def scan_sound(blocks: Iterable[SoundBlock]) -> CameraSound:
    """What is kept of a camera's sound, which is read once from its beginning to its end."""
    envelopes: list[tuple[float, NDArray[np.float16]]] = []
    end_s, loudest = 0.0, 0.0
    for chunk, begin_s, until_s in _chunks(blocks):
        loudest = max(loudest, float(np.abs(chunk.samples).max()))
        flux = _flux(_band_energies(chunk))[round(1e3 * begin_s) : round(1e3 * until_s)]
        even = flux[: len(flux) - len(flux) % _STEP].reshape(-1, _STEP).max(axis=1)
        envelopes.append((chunk.start_s + begin_s, even.astype(np.float16)))
        end_s = max(end_s, chunk.start_s + until_s)
    if not envelopes:
        return CameraSound(0.0, 0.0, 0.0, np.zeros(0, dtype=np.float16))
    start_s = envelopes[0][0]
    places = [max(0, round((part_s - start_s) / ENVELOPE_S)) for part_s, _ in envelopes]
    envelope = np.zeros(max(k + len(part) for k, (_, part) in zip(places, envelopes, strict=True)), np.float16)
    for place, (_, part) in zip(places, envelopes, strict=True):
        envelope[place : place + len(part)] = part
    return CameraSound(start_s, end_s, loudest, envelope)


def _chunks(blocks: Iterable[SoundBlock]) -> Iterator[tuple[SoundBlock, float, float]]:
    """Sound without a gap, with context on both sides of what is new in it, and from where to where that is [s].

    Chunks are of 10 s, the last of each run without a gap longer or shorter; the same whatever the size of blocks.
    """
    pieces: list[NDArray[np.float32]] = []
    count = 0
    rate_hz = 0.0
    start_s = 0.0
    begin_s = 0.0
    for block in blocks:
        late_s = block.start_s - start_s - count / max(rate_hz, 1.0)
        if count and (block.rate_hz != rate_hz or abs(late_s) > _RATE_TOLERANCE_S):
            yield SoundBlock(start_s, np.concatenate(pieces), rate_hz), begin_s, count / rate_hz
            pieces, count = [], 0
        if not count:
            rate_hz = block.rate_hz
            start_s = block.start_s
            begin_s = 0.0
        pieces.append(np.nan_to_num(block.samples))
        count += len(block.samples)
        while count >= (size := round((begin_s + _CHUNK_S + _CONTEXT_S) * rate_hz)):
            sound, passed = np.concatenate(pieces), round((begin_s + _CHUNK_S - _CONTEXT_S) * rate_hz)
            yield SoundBlock(start_s, sound[:size], rate_hz), begin_s, begin_s + _CHUNK_S
            # Stamps are rounded, and clocks of sound drift against those of images: each chunk follows the stamps.
            start_s, begin_s = start_s + passed / rate_hz, _CONTEXT_S
            pieces, count = [sound[passed:]], count - passed
    if count:
        yield SoundBlock(start_s, np.concatenate(pieces), rate_hz), begin_s, count / rate_hz


def _band_energies(chunk: SoundBlock) -> Array:
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


def _flux(energies: Array) -> Array:
    """How much louder (K,) it gets, all bands together, in no unit; a camera's gain takes no part."""
    floor = np.maximum(np.median(energies, axis=1, keepdims=True), _LEAST_ENERGY)
    # Each frame and those after it, against those before it.
    after = uniform_filter1d(energies, _AFTER, axis=1, mode="nearest", origin=-(_AFTER // 2))
    earlier = np.pad(energies, ((0, 0), (1, 0)), mode="edge")[:, :-1]
    before = uniform_filter1d(earlier, _BEFORE, axis=1, mode="nearest", origin=_BEFORE // 2 - 1)
    gain = np.log1p(np.maximum(after, 0.0) / floor) - np.log1p(np.maximum(before, 0.0) / floor)
    flux: Array = np.clip(gain, 0.0, None).sum(axis=0)
    return flux
