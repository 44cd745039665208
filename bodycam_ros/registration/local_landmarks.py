"""The landmarks that may be in view of a camera, and how often each is found.

A landmark's feature is visible from as far as its size allows. One pass over the map finds those in reach of a camera;
the result lasts until the camera has moved on.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.landmark_choice_kernels import landmarks_within
from bodycam_ros.registration.reference_map import ReferenceMap

_MARGIN = 0.05  # of the visible range of a usual landmark: a camera that moved so far searches again
_WIDER = 1.001  # of that margin, for rounding


class LocalLandmarks:
    """The landmarks around one camera.

    Args:
        reference_map: the map.
        focal_px: of the camera.
        least_sigma_px: of a feature that can be found [px].
    """

    def __init__(self, reference_map: ReferenceMap, focal_px: float, least_sigma_px: float) -> None:
        self._map, self._reach = reference_map, focal_px / least_sigma_px
        sizes = reference_map.landmark_sizes[reference_map.landmark_sizes > 0.0]
        self._margin = _MARGIN * self._reach * (float(np.median(sizes)) if len(sizes) else 0.0)
        self._centre: NDArray[np.float64] | None = None
        self._changes = 0
        self._rows = np.zeros(0, np.int64)

    def around(self, centre: NDArray[np.float64]) -> NDArray[np.int64]:
        """Rows (N,), ascending, of all landmarks in reach of a place (3,), and of some beyond."""
        moved = self._centre is None or not np.linalg.norm(centre - self._centre) <= self._margin
        if moved or self._changes != self._map.changes:
            self._centre, self._changes = np.array(centre, np.float64), self._map.changes
            points, sizes = self._map.points_world, self._map.landmark_sizes
            margin = _WIDER * self._margin
            self._rows = landmarks_within(self._centre, self._reach, margin, as_rows(points), sizes)
        return self._rows


_FADES = 0.998  # share of a judgement that is left an image later
_LATEST_SHARE = 0.2  # of the latest image in a judgement


class LandmarkTrust:
    """How often each landmark of a map was found, fading.

    Args:
        count: of landmarks.

    Attributes:
        values: (L,) float32 from -0.5 (never found) to 0.5 (always), 0 where unknown.
    """

    def __init__(self, count: int) -> None:
        self.values = np.zeros(count, np.float32)

    def update(self, rows: NDArray[np.int64], found: NDArray[np.bool_]) -> None:
        """An image in which landmarks (N,) were looked for, and which of them were found; all others fade."""
        self.values *= np.float32(_FADES)
        self.values[rows] += np.float32(_LATEST_SHARE) * (np.where(found, 0.5, -0.5) - self.values[rows])
