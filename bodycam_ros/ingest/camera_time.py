"""Where the time of one camera's video lies in the time of the recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class CameraTime:
    """A camera's clock: ``recording_s = start_s + (1 + drift) * media_s``.

    The reference camera has ``start_s = 0``, ``drift = 0`` and no uncertainty.

    Attributes:
        camera: its name.
        start_s: the time of the recording at the media time 0 [s].
        drift: seconds by which the recording's time gains on the media time, per second.
        start_sigma_s: standard deviation of ``start_s`` [s].
        drift_sigma: standard deviation of ``drift``.
        source: who says so: claps, sound, motion, telemetry or given.
    """

    camera: str
    start_s: float
    drift: float
    start_sigma_s: float
    drift_sigma: float
    source: str

    def recording_s(self, media_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times of the recording (N,) [s] at media times (N,) [s]."""
        times: NDArray[np.float64] = self.start_s + (1.0 + self.drift) * media_s
        return times
