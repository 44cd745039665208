"""A raw image, as a driver published it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.pixel_encoding import ENCODINGS


@dataclass(frozen=True, eq=False)
class RawPicture:
    """Values that are left as they came until somebody wants pixels: most want grey, and pay for no other.

    Attributes:
        encoding: of ``ENCODINGS``.
        values: (rows, W) or (rows, W, values) uint8 or uint16, maybe with a gap between the rows.
    """

    encoding: str
    values: NDArray[np.uint8] | NDArray[np.uint16]

    @property
    def nbytes(self) -> int:
        """Memory that the values take."""
        return self.values.nbytes

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""
        return ENCODINGS[self.encoding].grey(self.values)

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red; the caller's own."""
        return ENCODINGS[self.encoding].colour(self.values)
