"""Sudden sounds of one camera: when, how loud against what was before, how sharp, and their waveform (A section 3).

A sound of any length goes through in pieces; what is kept of it grows by some kilobytes a second at most.

Where claps are made is not known: by a clapper board in somebody's hands, as in A, or by the wearer's own. The first
reaches all cameras within the 2 to 3 ms that a body is long, and in what order nothing tells. If the wearer clapped,
ordinary proportions tell the larger part, and what is left is people's size and bearing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import butter, resample, sosfilt

from bodycam_ros.ingest.offset_agreement import SOUND_SPEED
from bodycam_ros.ingest.sound_settings import PeakSettings
from bodycam_ros.recording.sound import SoundBlock

FRAME_S = 0.001

BANDS_HZ = ((300.0, 1500.0), (1500.0, 5000.0), (5000.0, 12000.0))
"""Wind and steps lie beneath; a muffled camera keeps the lowest, AAC may drop what lies above."""

_MOST_OF_NYQUIST = 0.95

Array = NDArray[np.float64]


class BandEnergies:
    """The filters of one run of samples; what they remember goes from block to block.

    Args:
        rate_hz: samples per second [Hz]; bands above half of it are silent.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._filters = [_band_pass(band, rate_hz) for band in BANDS_HZ]
        self._memory = [None if sos is None else np.zeros((len(sos), 2)) for sos in self._filters]
        self._left_over = np.zeros((len(BANDS_HZ), 0))
        self._samples = 0  # of which the frames are known
        self._frames = 0

    def next(self, samples: NDArray[np.float32]) -> Array:
        """Mean squares (B, K) of the frames that end with these samples (N,); the rest waits for the next call."""
        squares = np.zeros((len(BANDS_HZ), len(samples)))
        for band, sos in enumerate(self._filters):
            if sos is not None:
                passed, self._memory[band] = sosfilt(sos, samples, zi=self._memory[band])
                squares[band] = passed**2
        squares = np.concatenate((self._left_over, squares), axis=1)
        last = int((self._samples + squares.shape[1]) / (FRAME_S * self._rate_hz))
        edges = np.ceil(np.arange(self._frames, last + 1) * FRAME_S * self._rate_hz).astype(int) - self._samples
        edges = edges[edges <= squares.shape[1]]
        if len(edges) < 2:
            self._left_over = squares
            return np.zeros((len(BANDS_HZ), 0))
        energies: Array = np.add.reduceat(squares[:, : edges[-1]], edges[:-1], axis=1) / np.diff(edges)
        self._left_over = squares[:, edges[-1] :]
        self._samples += int(edges[-1])
        self._frames += len(edges) - 1
        return energies


def _band_pass(band: tuple[float, float], rate_hz: float) -> Array | None:
    low, high = band
    high = min(high, _MOST_OF_NYQUIST * rate_hz / 2.0)
    if low >= high:
        return None
    sos: Array = butter(2, (low, high), "bandpass", fs=rate_hz, output="sos")
    return sos


SNIPPET_S, BEFORE_S = 0.06, 0.015
"""How much of the waveform of a peak is kept, and how much of that lies before it."""

SNIPPET_SAMPLES = 1440
"""A snippet has 24 kHz whatever the camera's rate: a clap has little above 12 kHz, and a phone's AAC nothing."""

ENVELOPE_S = 0.002
"""Step of the envelope that the sound as a whole is compared by."""

_CHUNK_FRAMES = 10_000
_CONTEXT_FRAMES = 64  # around a chunk: what the rise of a peak and its snippet need
_AFTER, _GAP, _BEFORE = 4, 6, 8  # frames; the gap steps over the pre-echo of AAC
_LEAST_ENERGY = 1e-10  # -100 dB of full scale: what is below is digital silence
_LARGEST_RISE_DB = 60.0
_RATE_TOLERANCE_S = 0.02
_FOLLOWED = 0.01  # share of a block's deviation that the clock of a run takes over: stamps are rounded


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


def scan_sound(blocks: Iterator[SoundBlock], settings: PeakSettings) -> CameraSound:
    """Listen to a camera's sound once, from its beginning to its end."""
    runs: list[_Run] = []
    for block in blocks:
        if not len(block.samples):
            continue
        if not runs or not runs[-1].takes(block):
            if runs:
                runs[-1].finish()
            runs.append(_Run(block, settings))
        runs[-1].add(block)
    if not runs:
        return CameraSound(0.0, 0.0, 0.0, (), np.zeros(0, dtype=np.float16))
    runs[-1].finish()
    start_s = runs[0].start_s
    peaks = sorted((peak for run in runs for peak in run.peaks), key=lambda peak: peak.media_s)
    return CameraSound(
        start_s,
        max(run.end_s for run in runs),
        max(run.loudest for run in runs),
        tuple(peaks),
        _joined(start_s, [(run.start_s, np.concatenate([*run.envelope, np.zeros(0, np.float16)])) for run in runs]),
    )


def _joined(start_s: float, parts: list[tuple[float, NDArray[np.float16]]]) -> NDArray[np.float16]:
    places = [(max(0, round((part_s - start_s) / ENVELOPE_S)), values) for part_s, values in parts]
    joined = np.zeros(max(place + len(values) for place, values in places), dtype=np.float16)
    for place, values in places:
        joined[place : place + len(values)] = values
    return joined


class _Run:
    """Samples without a gap between them."""

    def __init__(self, first: SoundBlock, settings: PeakSettings) -> None:
        self._settings = settings
        self._rate_hz = first.rate_hz
        self._bands = BandEnergies(first.rate_hz)
        self.start_s = first.start_s
        self.loudest = 0.0
        self.peaks: list[SoundPeak] = []
        self.envelope: list[NDArray[np.float16]] = []
        self._samples = np.zeros(0, dtype=np.float32)
        self._first_sample = self._heard = 0
        self._energies = np.zeros((3, 0))
        self._first_frame = self._done_frames = 0
        self._last_frame = -_CHUNK_FRAMES  # of the last peak
        self._pending: list[NDArray[np.float32]] = []
        self._pending_count = 0
        self._open_window: list[SoundPeak] = []

    @property
    def end_s(self) -> float:
        return self._time_of(self._heard)

    def _time_of(self, sample: float) -> float:
        return self.start_s + sample / self._rate_hz

    def takes(self, block: SoundBlock) -> bool:
        return block.rate_hz == self._rate_hz and abs(block.start_s - self.end_s) <= _RATE_TOLERANCE_S

    def add(self, block: SoundBlock) -> None:
        self.start_s += _FOLLOWED * (block.start_s - self.end_s)
        samples = np.nan_to_num(np.asarray(block.samples, dtype=np.float32))
        self._heard += len(samples)
        self._pending.append(samples)
        self._pending_count += len(samples)
        if self._pending_count >= _CHUNK_FRAMES * FRAME_S * self._rate_hz:
            self._listen()

    def finish(self) -> None:
        # Behind the end everything stays as it was, so that a rise at the very end is none.
        self._listen(last=True)
        self._close_windows(np.inf)

    def _listen(self, last: bool = False) -> None:
        fresh = np.concatenate([*self._pending, np.zeros(0, np.float32)])
        self._pending, self._pending_count = [], 0
        if len(fresh):
            self.loudest = max(self.loudest, float(np.abs(fresh).max()))
        self._samples = np.concatenate((self._samples, fresh))
        self._energies = np.concatenate((self._energies, self._bands.next(fresh)), axis=1)
        known = self._first_frame + self._energies.shape[1]
        until = known if last else known - _CONTEXT_FRAMES
        if until > self._done_frames:
            self._find(until)
            self._done_frames = until
            self._forget(until - _CONTEXT_FRAMES)

    def _forget(self, frame: int) -> None:
        surplus = frame - self._first_frame
        if surplus > 0:
            self._energies = self._energies[:, surplus:]
            self._first_frame = frame
            sample = int(frame * FRAME_S * self._rate_hz)
            self._samples = self._samples[sample - self._first_sample :]
            self._first_sample = sample

    def _find(self, until: int) -> None:
        """Peaks and envelope of the frames from the last that is done on."""
        rises, flux = _rises(self._energies), _flux(self._energies)
        begin, end = self._done_frames - self._first_frame, until - self._first_frame
        step = round(ENVELOPE_S / FRAME_S)
        even = flux[begin : end - (end - begin) % step].reshape(-1, step).max(axis=1)
        self.envelope.append(even.astype(np.float16))
        reach = round(0.5 * self._settings.min_gap / FRAME_S)
        strength = np.sort(rises, axis=0)[-2:].mean(axis=0)
        highest = (strength >= maximum_filter1d(strength, 2 * reach + 1)) & (strength >= self._settings.min_rise_db)
        for frame in np.flatnonzero(highest[begin:end]) + begin:
            if self._first_frame + frame - self._last_frame >= reach:  # of equals the first
                self._note(int(frame), float(strength[frame]))
                self._last_frame = self._first_frame + int(frame)

    def _note(self, frame: int, strength: float) -> None:
        around = self._energies[:, max(0, frame - 3) : frame + 6].sum(axis=0)
        middle = max(0, frame - 3) + int(np.argmax(np.diff(around, prepend=around[0])))
        sample = (self._first_frame + middle) * FRAME_S * self._rate_hz
        snippet, amplitude, first = self._snippet(sample)
        peak = SoundPeak(
            self._time_of(sample),
            strength,
            _sharpness(self._energies, middle),
            amplitude,
            snippet,
            self._time_of(first),
        )
        window = int(peak.media_s // self._settings.window)
        self._close_windows(window)
        self._open_window.append(peak)

    def _close_windows(self, window: float) -> None:
        if self._open_window and self._open_window[0].media_s // self._settings.window < window:
            strongest = sorted(self._open_window, key=lambda peak: -peak.rise_db)[: self._settings.most_per_window]
            self.peaks += strongest
            self._open_window = []

    def _snippet(self, sample: float) -> tuple[NDArray[np.float16], float, int]:
        """Waveform around a sample of the run, its largest value, and the sample that it begins with."""
        length = round(SNIPPET_S * self._rate_hz)
        first = round(sample - BEFORE_S * self._rate_hz)
        cut = np.zeros(length)
        low, high = max(first, self._first_sample), min(first + length, self._first_sample + len(self._samples))
        if high > low:
            cut[low - first : high - first] = self._samples[low - self._first_sample : high - self._first_sample]
        waveform = resample(cut, SNIPPET_SAMPLES)
        largest = float(np.abs(waveform).max())
        return (waveform / largest if largest > 0.0 else waveform).astype(np.float16), largest, first


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


WAYS_M: Mapping[str, float] = {
    "hand": 0.1,
    "forearm": 0.25,
    "upper_arm": 0.45,
    "torso": 0.4,
    "head": 0.5,
    "pelvis": 0.45,
    "thigh": 0.65,
    "shin": 1.05,
    "foot": 1.35,
}
"""From hands that clap before the chest of a person of 1.75 m to the middle of each segment [m], by kind of segment."""

OWN_CLAP_SIGMA_M = 0.12
"""What is left of the way once it is corrected: size, bearing, and on which side the camera is [m]."""


def travel_s(cameras: Mapping[str, str]) -> dict[str, float]:
    """Camera -> nominal time [s] from the wearer's clapping hands, of those whose segment has an ordinary name.

    Args:
        cameras: camera -> segment that it is strapped to.
    """
    return {
        camera: WAYS_M[kind] / SOUND_SPEED for camera, segment in cameras.items() if (kind := _kind(segment)) in WAYS_M
    }


def _kind(segment: str) -> str:
    return segment.removesuffix("_left").removesuffix("_right")
