"""Landmarks to look for in an image: in view, spread over it, the most trusted of every cell.

A choice by the determinant of the pose's information (D-optimality) was measured and is worse at the same cost
(docs/benchmarks.md).
"""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.lens_kernels import PERSPECTIVE, project_point
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

CELLS = 8
"""Columns and rows of the image."""

LEAST_SIGMA_PX = 0.8
"""[px] of a landmark's feature: a smaller one is blurred away in the image."""

_BORDER = 6.0  # [px] of an image that patches keep out of
_LEAST_COSINE = 0.2  # between a surface's normal and the view
_LEAST_AXIS_COSINE = math.cos(math.radians(84.0))  # of the view to the optical axis: the rim of a fisheye is left out
_FINER_IS_BETTER = 0.15  # of a cosine, for each halving of a photograph's scale below the image's


@kernel(
    "(f8[::1], f8[::1], f8[:, ::1], f8[::1], f8, f4[:, ::1], f4[::1], i8)",
)
def choose_landmarks(
    lens: Array,
    gains: Array,
    world_T_camera: Array,
    twist: Array,
    readout_time: float,
    surfaces: NDArray[np.float32],
    trust: NDArray[np.float32],
    per_cell: int,
) -> Whole:
    """Rows (N,) of the landmarks in view, cell by cell.

    Args:
        lens, gains: of the camera; see ``radial_gains``.
        world_T_camera: (4, 4) its pose.
        twist, readout_time: (6,) its motion [rad/s, m/s], and the read-out time of its rows [s].
        surfaces: (7, L) places of landmarks [m], normals of their surfaces, and sizes of their features [m].
        trust: (L,) how often each was found, -0.5 to 0.5.
        per_cell: landmarks of each cell, the most trusted.
    """
    width, height = lens[1], lens[2]
    best = np.full((CELLS * CELLS, per_cell), -1, np.int64)
    score = np.full((CELLS * CELLS, per_cell), -math.inf)
    T = world_T_camera
    sizes, may_be_seen = surfaces[6], np.empty(len(trust), np.bool_)
    _mark_near_and_facing(T, lens[3], surfaces, may_be_seen)
    for i in range(len(trust)):
        if not may_be_seen[i]:
            continue
        x, y, z, dx, dy, dz = in_camera(T, surfaces[0, i], surfaces[1, i], surfaces[2, i])
        u, v = _project_by_table(lens, gains, x, y, z)
        if readout_time != 0.0:
            time_s = readout_time * (v / (height - 1.0) - 0.5)
            u, v = _project_by_table(lens, gains, *_moved(x, y, z, twist, time_s))
        if not (u > _BORDER and v > _BORDER and u < width - 1 - _BORDER and v < height - 1 - _BORDER):
            continue
        cell = int(v * CELLS / height) * CELLS + int(u * CELLS / width)
        merit, k = trust[i], per_cell - 1
        if merit <= score[cell, k]:
            continue
        merit -= 0.05 * abs(math.log2(0.5 * lens[3] * sizes[i] / math.sqrt(dx * dx + dy * dy + dz * dz)))
        if merit <= score[cell, k]:
            continue
        while k > 0 and merit > score[cell, k - 1]:
            score[cell, k], best[cell, k] = score[cell, k - 1], best[cell, k - 1]
            k -= 1
        score[cell, k], best[cell, k] = merit, i
    rows = np.empty(CELLS * CELLS * per_cell, np.int64)
    count = 0
    for cell in range(CELLS * CELLS):
        for k in range(per_cell):
            if best[cell, k] >= 0:
                rows[count] = best[cell, k]
                count += 1
    return rows[:count].copy()


@kernel()
def _mark_near_and_facing(
    world_T_camera: Array, focal_px: float, surfaces: NDArray[np.float32], marks: NDArray[np.bool_]
) -> None:
    """Mark (L,) which landmarks are large enough, in front of a camera, and on surfaces that face it.

    Without roots and branches, and in single precision, so that eight are tested at once: most are out of view.
    """
    single = np.float32
    T = world_T_camera
    x, y, z = single(T[0, 3]), single(T[1, 3]), single(T[2, 3])
    axis_x, axis_y, axis_z = single(T[0, 2]), single(T[1, 2]), single(T[2, 2])
    reach = single((focal_px / LEAST_SIGMA_PX) ** 2)
    least_axis, least_facing, zero = single(_LEAST_AXIS_COSINE**2), single(_LEAST_COSINE**2), single(0.0)
    for i in range(len(marks)):
        dx, dy, dz = surfaces[0, i] - x, surfaces[1, i] - y, surfaces[2, i] - z
        squared = dx * dx + dy * dy + dz * dz
        along = axis_x * dx + axis_y * dy + axis_z * dz
        away = surfaces[3, i] * dx + surfaces[4, i] * dy + surfaces[5, i] * dz
        marks[i] = (
            (reach * surfaces[6, i] * surfaces[6, i] >= squared)
            & (along > zero)
            & (along * along >= least_axis * squared)
            & (away < zero)
            & (away * away >= least_facing * squared)
        )


@kernel(
    "(f8[::1], f8[:, ::1], f8[:, ::1], i8[::1], f8[:, ::1], u2[::1], f8[:, :, ::1], i8[::1], u2[::1])",
)
def best_views(
    scales: Array,
    world_T_camera: Array,
    points_world: Array,
    rows: Whole,
    reference_scales: Array,
    camera_of_view: NDArray[np.uint16],
    world_T_reference: Array,
    first_observation: Whole,
    observation_view: NDArray[np.uint16],
) -> Whole:
    """For each landmark (rows, (N,)) the photograph most similar to the camera's view: from its side, and fine enough.

    Args:
        scales: (S,) of the camera's lens, see ``local_scales``.
        world_T_camera: (4, 4) its pose.
        points_world: (L, 3) [m].
        rows: (N,) of the landmarks.
        reference_scales: (C, S) of the lenses of the photographs.
        camera_of_view: (K,) which of them took each.
        world_T_reference: (K, 4, 4) where from.
        first_observation: (L + 1,) where the observations of each landmark begin.
        observation_view: (O,) their photographs.
    """
    views = np.empty(len(rows), np.int64)
    for n in range(len(rows)):
        i = rows[n]
        views[n] = -1
        if first_observation[i] == first_observation[i + 1]:
            continue
        ax, ay, az, scale = _view_of(scales, world_T_camera, points_world[i])
        best = -math.inf
        for o in range(first_observation[i], first_observation[i + 1]):
            k = observation_view[o]
            bx, by, bz, shown = _view_of(reference_scales[camera_of_view[k]], world_T_reference[k], points_world[i])
            merit = ax * bx + ay * by + az * bz
            if shown < scale:
                merit -= _FINER_IS_BETTER * math.log2(scale / shown)
            if merit > best:
                best, views[n] = merit, k
    return views


@kernel()
def _view_of(scales: Array, world_T_camera: Array, point: Array) -> tuple[float, float, float, float]:
    """Unit direction from a camera to a point of the world, and its scale in the image [px/m]."""
    T = world_T_camera
    dx, dy, dz = point[0] - T[0, 3], point[1] - T[1, 3], point[2] - T[2, 3]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / distance, dy / distance, dz / distance
    cosine = T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz
    nearest = int(0.5 * (cosine + 1.0) * (len(scales) - 1) + 0.5)
    return dx, dy, dz, scales[min(max(nearest, 0), len(scales) - 1)] / distance


@kernel()
def in_camera(world_T_camera: Array, x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """A point of the world in the camera's axes, and its offset from the camera in the world's."""
    T = world_T_camera
    dx, dy, dz = x - T[0, 3], y - T[1, 3], z - T[2, 3]
    return (
        T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz,
        T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz,
        T[0, 2] * dx + T[1, 2] * dy + T[2, 2] * dz,
        dx,
        dy,
        dz,
    )


@kernel()
def project_moving(
    lens: Array, x: float, y: float, z: float, twist: Array, readout_time: float
) -> tuple[float, float, bool]:
    """Pixel of a point in the image of a moving camera, at the time when its row is read out."""
    u, v, valid = project_point(lens, x, y, z)
    if readout_time == 0.0 or not valid:
        return u, v, valid
    for _ in range(2):
        time_s = readout_time * (v / (lens[2] - 1.0) - 0.5)
        u, v, valid = project_point(lens, *_moved(x, y, z, twist, time_s))
        if not valid:
            break
    return u, v, valid


@kernel()
def _moved(x: float, y: float, z: float, twist: Array, time_s: float) -> tuple[float, float, float]:
    """A point in the axes of a camera that has moved on, to the first order."""
    return (
        x + time_s * (y * twist[2] - z * twist[1] - twist[3]),
        y + time_s * (z * twist[0] - x * twist[2] - twist[4]),
        z + time_s * (x * twist[1] - y * twist[0] - twist[5]),
    )


@kernel()
def _project_by_table(lens: Array, gains: Array, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel of a point in the camera's axes to 1e-3 px, at a third of the time; NaN out of the lens' view."""
    if lens[0] == PERSPECTIVE:
        u, v, _ = project_point(lens, x, y, z)
        return u, v
    near = 1.0 / math.sqrt(x * x + y * y + z * z)
    place = 0.5 * (z * near + 1.0) * (len(gains) - 1)
    if math.isnan(place):  # moved by the time of a row that is out of view: as a whole number it is anywhere
        return math.nan, math.nan
    below = min(int(place), len(gains) - 2)
    gain = near * (gains[below] + (place - below) * (gains[below + 1] - gains[below]))
    return lens[3] * gain * x + lens[5], lens[4] * gain * y + lens[6]
