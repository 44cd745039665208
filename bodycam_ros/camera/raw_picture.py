"""A raw image with colours, as a driver published it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class RawPicture:
    """Pixels whose order is left as it came until somebody wants them: most want grey, and pay for no other.

    Attributes:
        pixels: (H, W, 3) uint8, maybe of rows with a gap between them.
        red_first: red, green, blue; else blue, green, red.
    """

    pixels: NDArray[np.uint8]
    red_first: bool

    @property
    def nbytes(self) -> int:
        """Memory that the pixels take."""
        return self.pixels.nbytes

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""
        code = cv2.COLOR_RGB2GRAY if self.red_first else cv2.COLOR_BGR2GRAY
        return np.asarray(cv2.cvtColor(self.pixels, code), dtype=np.uint8)

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red."""
        if self.red_first:
            return np.asarray(cv2.cvtColor(self.pixels, cv2.COLOR_RGB2BGR), dtype=np.uint8)
        return np.array(self.pixels, dtype=np.uint8, order="C")
