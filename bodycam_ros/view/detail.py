"""How finely the view draws: a graphics card bears more than a processor that does its work."""

from dataclasses import dataclass

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array


@dataclass(frozen=True)
class Detail:
    """What a picture may be made of.

    Attributes:
        faces: of each mesh on a segment, at most.
        landmarks: of the map, at most.
        resolution: pixels drawn for each of the window's, along one side; None: as the browser likes.
    """

    faces: int
    landmarks: int
    resolution: float | None

    @property
    def page(self) -> str:
        """What the address of the page ends in."""
        return "" if self.resolution is None else f"/?fixedDpr={self.resolution:g}"

    def mesh(self, vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
        """A mesh (V, 3) [m], (F, 3) with as many faces as are drawn, of the same shape as nearly as they allow."""
        if len(faces) <= self.faces:
            return vertices, faces
        fewer = fast_simplification.simplify(vertices.astype(np.float32), faces, target_count=self.faces)
        return fewer[0].astype(np.float64), fewer[1].astype(np.int32)

    def chosen(self, landmarks: int) -> slice:
        """Which of so many landmarks are drawn: they are spread evenly over the map's order, which is nobody's."""
        return slice(None, None, -(-landmarks // self.landmarks) or 1)


FINE = Detail(faces=400, landmarks=100_000, resolution=None)
COARSE = Detail(faces=80, landmarks=4_000, resolution=0.4)
