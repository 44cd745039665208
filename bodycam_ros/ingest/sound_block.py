"""Sound of a camera, as it is handed over piece by piece."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SoundBlock:
    """Some samples in a row.

    Attributes:
        start_s: media time of the first sample [s].
        samples: (N,) one channel, full scale is 1.
        rate_hz: samples per second of media time [Hz].
    """

    start_s: float
    samples: NDArray[np.float32]
    rate_hz: float


SoundSource = Callable[[], Iterator[SoundBlock]]
"""Opens a camera's sound from its beginning; blocks come in order of time, and none if the camera has no sound."""
