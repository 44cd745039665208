"""The sound of a file, block by block: two hours of it never are in memory together."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from av import AudioFrame
from av.error import FFmpegError
from numpy.typing import NDArray

from bodycam_ros.recording.video_file import demuxed, opened

_BLOCK_S = 0.5
_GAP_S = 0.002
"""Sound that goes on within this time is one block; times in a file are rounded, to a millisecond at worst."""


@dataclass(frozen=True, eq=False)
class SoundBlock:
    """Some sound without a gap.

    Attributes:
        start_s: media time of the first sample [s].
        samples: (N,) float32, all channels together, -1 to 1.
        rate_hz: samples per second.
    """

    start_s: float
    samples: NDArray[np.float32]
    rate_hz: float

    def later(self, seconds: float) -> "SoundBlock":
        """The same sound at a later time."""
        return replace(self, start_s=self.start_s + seconds)


SoundSource = Callable[[], Iterator[SoundBlock]]
"""Opens a camera's sound from its beginning; blocks come in order of time, and none if the camera has no sound."""


def sound_blocks(path: Path) -> Iterator[SoundBlock]:
    """The sound of a file, in blocks of half a second; where some is missing or damaged a block ends.

    A file without sound gives none; one that is cut off ends where it does.

    Raises:
        RecordingError: the file cannot be opened.
    """
    pending: list[NDArray[np.float32]] = []
    start_s, rate_hz, count = 0.0, 0.0, 0
    for at_s, rate, samples in _pieces(path):
        if pending and (abs(at_s - start_s - count / rate_hz) > _GAP_S or rate != rate_hz or count >= _BLOCK_S * rate):
            yield SoundBlock(start_s, np.concatenate(pending), rate_hz)
            pending = []
        if not pending:
            start_s, rate_hz, count = at_s, rate, 0
        pending.append(samples)
        count += len(samples)
    if pending:
        yield SoundBlock(start_s, np.concatenate(pending), rate_hz)


def _pieces(path: Path) -> Iterator[tuple[float, float, NDArray[np.float32]]]:
    """What the decoder gives: media time [s], rate [Hz] and samples."""
    with opened(path) as container:
        if not container.streams.audio:
            return
        for packet in demuxed(container, container.streams.audio[0]):
            try:
                frames = packet.decode()
            except (FFmpegError, ValueError):
                continue  # damaged
            for frame in frames:
                if frame.pts is not None and frame.samples:
                    yield float(frame.pts * (frame.time_base or 0)), float(frame.sample_rate), _mono(frame)


def _mono(frame: AudioFrame) -> NDArray[np.float32]:
    values = frame.to_ndarray()
    channels = len(frame.layout.channels)
    # Planar sound has a row per channel, packed sound one row in which they take turns.
    by_channel = values if frame.format.is_planar else values.reshape(-1, channels).T
    if by_channel.dtype.kind == "f":
        scaled = by_channel.astype(np.float32)
    else:
        middle = 128.0 if by_channel.dtype == np.uint8 else 0.0
        full = 2.0 ** (8 * by_channel.dtype.itemsize - 1)
        scaled = ((by_channel.astype(np.float64) - middle) / full).astype(np.float32)
    mono: NDArray[np.float32] = np.nan_to_num(scaled.mean(axis=0), nan=0.0, posinf=0.0, neginf=0.0)
    return mono
