"""The sound of a file, block by block: two hours of it never are in memory together."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from bodycam_ros.recording.video_file import demuxed, opened


@dataclass(frozen=True, eq=False)
class SoundBlock:
    """Some sound without a gap.

    Attributes:
        start_s: media time of the first sample [s].
        samples: (N,) float32, all channels together; 1 is full scale.
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
        mono = av.AudioResampler(format="flt", layout="mono")
        for packet in demuxed(container, container.streams.audio[0]):
            try:
                frames = [each for frame in packet.decode() if frame.pts is not None for each in mono.resample(frame)]
            except (FFmpegError, ValueError):
                continue  # damaged
            for frame in frames:
                start_s = float((frame.pts or 0) * (frame.time_base or 0))
                yield SoundBlock(start_s, np.asarray(frame.to_ndarray()[0], np.float32), float(frame.sample_rate))
