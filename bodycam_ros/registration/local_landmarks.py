"""The landmarks that may be in view of a camera, found without a pass over all of the map, and how often each is found.

A landmark's feature is visible from as far as its size allows, so landmarks lie in a grid of cells for every octave of
sizes, and a camera searches the cells around it. The result lasts until the camera has moved on.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.landmark_choice_kernels import CELL_SIZES, cells_of, landmarks_around

_MARGIN = 0.05  # of the visible range of a usual landmark: a camera that moved so far searches again
_WIDER = 1.001  # of that margin, for rounding
_MANY_LOOSE = 4096
_LOOSE_SHARE = 32


class LandmarkGrid:
    """The landmarks of a map in cells; all cameras may share it.

    Args:
        points_world: (L, 3) float64 [m].
        sizes: (L,) float32 of the largest feature of each [m]; one without a size is never found.

    Attributes:
        changes: how often landmarks have changed.
        usual_size: of a landmark that has one [m].
    """

    def __init__(self, points_world: NDArray[np.float64], sizes: NDArray[np.float32]) -> None:
        self._points, self._sizes = as_rows(points_world), sizes
        self._is_loose = np.zeros(len(sizes), bool)
        self._loose = self._rows = self._cells = self._first_of_octave = np.zeros(0, np.int64)
        self._largest = np.zeros(0)
        self.changes = self._found_loose = 0
        self._sort()
        self.usual_size = float(np.median(sizes[self._rows])) if len(self._rows) else 0.0

    def put(self, rows: NDArray[np.int64]) -> None:
        """Landmarks (N,) of the arrays have moved, appeared, or vanished (size 0)."""
        self._is_loose[rows] = True
        self.changes += 1

    def around(self, centre: NDArray[np.float64], reach: float, margin: float) -> NDArray[np.int64]:
        """Rows (N,), ascending, of the landmarks no farther than ``reach * size + margin`` [m] from a place (3,)."""
        if self._found_loose != self.changes:
            self._find_loose()
        found = landmarks_around(
            as_rows(centre),
            reach,
            margin,
            self._points,
            self._sizes,
            self._rows,
            self._cells,
            self._first_of_octave,
            self._largest,
            self._is_loose,
        )
        if len(self._loose):
            offsets = self._points[self._loose] - centre
            far = reach * self._sizes[self._loose].astype(float) + margin
            near = (np.einsum("ij,ij->i", offsets, offsets) <= far**2) & (self._sizes[self._loose] > 0.0)
            found = np.concatenate([found, self._loose[near]])
        return np.sort(found)

    def _find_loose(self) -> None:
        """List the landmarks that are in no cell; sort all anew where these are many."""
        self._found_loose = self.changes
        self._loose = np.flatnonzero(self._is_loose)
        if len(self._loose) > max(_MANY_LOOSE, len(self._rows) // _LOOSE_SHARE):
            self._sort()

    def _sort(self) -> None:
        """All landmarks into their cells."""
        self._is_loose[:] = False
        self._loose = np.zeros(0, np.int64)
        rows = np.flatnonzero(self._sizes > 0.0)
        octaves = np.frexp(self._sizes[rows])[1].astype(np.int64)
        present, octave = np.unique(octaves, return_inverse=True)
        self._largest = np.ldexp(1.0, present)
        cells = cells_of(self._points[rows], as_rows(CELL_SIZES * self._largest[octave]))
        order = np.lexsort((rows, cells, octave))
        self._rows, self._cells = rows[order], cells[order]
        self._first_of_octave = np.searchsorted(octave[order], np.arange(len(present) + 1)).astype(np.int64)


class LocalLandmarks:
    """The landmarks around one camera.

    Args:
        grid: of the map.
        focal_px: of the camera.
        least_sigma_px: of a feature that can be found [px].
    """

    def __init__(self, grid: LandmarkGrid, focal_px: float, least_sigma_px: float) -> None:
        self._grid = grid
        # Where every feature is large enough, every landmark is in reach.
        self._reach = focal_px / max(least_sigma_px, 1e-9)
        self._margin = _MARGIN * self._reach * grid.usual_size
        self._centre: NDArray[np.float64] | None = None
        self._changes = 0
        self._rows = np.zeros(0, np.int64)

    def around(self, centre: NDArray[np.float64]) -> NDArray[np.int64]:
        """Rows (N,), ascending, of all landmarks in reach of a place (3,), and of some beyond."""
        moved = self._centre is None or not np.linalg.norm(centre - self._centre) <= self._margin
        if moved or self._changes != self._grid.changes:
            self._centre, self._changes = np.array(centre, np.float64), self._grid.changes
            self._rows = self._grid.around(self._centre, self._reach, _WIDER * self._margin)
        return self._rows


_FADES = 0.998  # share of a judgement that is left an image later
_LEAST_SCALE = 1e-12  # far from the smallest float32
_LATEST_SHARE = 0.2  # of the latest image in a judgement


class LandmarkTrust:
    """How often each landmark of a map was found, fading; an image costs as much as the landmarks that it looks for.

    Args:
        count: of landmarks.

    Attributes:
        scaled: (L,) float32; times ``scale`` it is from -0.5 (never found) to 0.5 (always), 0 where unknown.
        scale: the same for all landmarks.
    """

    def __init__(self, count: int) -> None:
        self.scaled = np.zeros(count, np.float32)
        self.scale = 1.0

    def update(self, rows: NDArray[np.int64], found: NDArray[np.bool_]) -> None:
        """An image in which landmarks (N,) were looked for, and which of them were found; all others fade."""
        self.scale *= _FADES
        if self.scale < _LEAST_SCALE:
            self.scaled *= np.float32(self.scale)
            self.scale = 1.0
        judged = np.where(found, 0.5, -0.5) / self.scale
        self.scaled[rows] += _LATEST_SHARE * (judged - self.scaled[rows])
