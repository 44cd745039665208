"""Energy of sound by band and millisecond: what tells a clap from wind, and still hears it through a cover."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

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
