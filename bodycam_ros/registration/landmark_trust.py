"""How far one camera trusts each landmark: those that it finds it asks again, those that it does not, less."""

import numpy as np
from numpy.typing import NDArray

_FADES = 0.998  # what is left of a judgement an image later
_LEAST_SCALE = 1e-12  # far from the smallest float32


class LandmarkTrust:
    """Judgements of all landmarks of a map, which fade; an image costs as much as the landmarks that it asks.

    Args:
        count: of landmarks.
        forget: share that the latest image has in a judgement.

    Attributes:
        scaled: (L,) float32; times ``scale`` this is how much more than usual a landmark is trusted, from -0.5 (never
            found) to 0.5 (always).
        scale: the same for all landmarks.
    """

    def __init__(self, count: int, forget: float) -> None:
        self._forget = forget
        self.scaled = np.zeros(count, np.float32)
        self.scale = 1.0

    def learn(self, rows: NDArray[np.int64], found: NDArray[np.bool_]) -> None:
        """An image in which landmarks (N,) were asked for, and which of them were found; all others fade."""
        self.scale *= _FADES
        if self.scale < _LEAST_SCALE:
            self.scaled *= np.float32(self.scale)
            self.scale = 1.0
        judged = np.where(found, 0.5, -0.5) / self.scale
        self.scaled[rows] += self._forget * (judged - self.scaled[rows])
