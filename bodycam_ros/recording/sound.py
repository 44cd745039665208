"""The sound of a file, block by block: two hours of it never are in memory together."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from av import AudioFrame
from av.error import FFmpegError
from numpy.typing import NDArray

from bodycam_ros.recording.video_file import demuxed, opened


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


SoundSource = Callable[[], Iterator[SoundBlock]]
"""Opens a camera's sound from its beginning; blocks come in order of time, and none if the camera has no sound."""


def sound_blocks(path: Path) -> Iterator[SoundBlock]:
    """The sound of a file, in blocks as the decoder gives it; what is missing or damaged is left out.

    A file without sound gives none; one that is cut off ends where it does.

    Raises:
        RecordingError: the file cannot be opened.
    """
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
                    start_s = float(frame.pts * (frame.time_base or 0))
                    yield SoundBlock(start_s, _mono(frame), float(frame.sample_rate))


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
