"""The landmarks that are near enough to be seen, by a grid of cells for every octave of their sizes."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

CELL_SIZES = 128.0
"""Edge of a cell, times the largest size of its octave: a camera of 240 px sees a landmark from two or three cells."""

_BITS = 19  # of a cell's place along one axis
_HALF = 1 << (_BITS - 1)


@kernel("(f8[:, ::1], f8[::1])")
def cells_of(points_world: Array, edges: Array) -> Whole:
    """(L,) numbers of the cells that points (L, 3) lie in, each in a grid of its own edge; along x they follow on."""
    cells = np.empty(len(points_world), np.int64)
    for i in range(len(points_world)):
        x, y, z = points_world[i, 0] / edges[i], points_world[i, 1] / edges[i], points_world[i, 2] / edges[i]
        cells[i] = _cell(_step(x), _step(y), _step(z))
    return cells


@kernel("(f8[::1], f8, f8, f8[:, ::1], f4[::1], i8[::1], i8[::1], i8[::1], f8[::1], b1[::1])")
def landmarks_around(
    centre: Array,
    reach: float,
    margin: float,
    points_world: Array,
    sizes: NDArray[np.float32],
    rows: Whole,
    cells: Whole,
    first_of_octave: Whole,
    largest: Array,
    loose: NDArray[np.bool_],
) -> Whole:
    """Rows (N,) of the landmarks that are no farther than ``reach * size + margin``, in no order.

    Args:
        centre: (3,) [m].
        reach: how far a landmark is seen, times its size.
        margin: [m].
        points_world, sizes: (L, 3), (L,) of all landmarks [m].
        rows: (M,) those in the grid, by octave and then by cell.
        cells: (M,) where they are, see ``cells_of``.
        first_of_octave: (O + 1,) where in these each octave begins.
        largest: (O,) largest size that an octave may have [m].
        loose: (L,) landmarks that are not where the grid has them, and are left out.
    """
    found = np.empty(len(rows), np.int64)
    count = 0
    for octave in range(len(largest)):
        begin, end = first_of_octave[octave], first_of_octave[octave + 1]
        edge, far = CELL_SIZES * largest[octave], reach * largest[octave] + margin
        x0, x1 = _step((centre[0] - far) / edge), _step((centre[0] + far) / edge)
        y0, y1 = _step((centre[1] - far) / edge), _step((centre[1] + far) / edge)
        z0, z1 = _step((centre[2] - far) / edge), _step((centre[2] + far) / edge)
        # Where there are fewer landmarks than columns of cells, none is looked for.
        all_of_them = (y1 - y0 + 1) * (z1 - z0 + 1) > end - begin
        for z in range(z0, z0 + 1 if all_of_them else z1 + 1):
            for y in range(y0, y0 + 1 if all_of_them else y1 + 1):
                j = begin if all_of_them else _first(cells, begin, end, _cell(x0, y, z))
                last = _cell(x1, y, z)
                while j < end and (all_of_them or cells[j] <= last):
                    i = rows[j]
                    j += 1
                    dx, dy, dz = (
                        points_world[i, 0] - centre[0],
                        points_world[i, 1] - centre[1],
                        points_world[i, 2] - centre[2],
                    )
                    near = reach * sizes[i] + margin
                    if dx * dx + dy * dy + dz * dz <= near * near and not loose[i]:
                        found[count] = i
                        count += 1
    return found[:count].copy()


@kernel()
def _step(along: float) -> int:
    """A cell's place along one axis; what is farther than the grid reaches lies in its last cell."""
    return int(min(max(math.floor(along), -float(_HALF)), float(_HALF - 1)))


@kernel()
def _cell(x: int, y: int, z: int) -> int:
    return (((z + _HALF) << _BITS) + y + _HALF << _BITS) + x + _HALF


@kernel()
def _first(cells: Whole, begin: int, end: int, least: int) -> int:
    """The first place from ``begin`` on whose cell is no less."""
    while begin < end:
        middle = (begin + end) // 2
        if cells[middle] < least:
            begin = middle + 1
        else:
            end = middle
    return begin
