"""The steps of a direct registration, each as one kernel: the predicted pose corrected, landmarks chosen, a pose found.

The camera's motion while its rows are read out is a vector and the pose of the image before, as ``fit_kernel`` takes
them; the vector is empty where all rows are exposed together.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel
from bodycam_ros.registration.landmark_choice_kernels import best_views, choose_landmarks
from bodycam_ros.registration.patch_kernels import align_patches
from bodycam_ros.registration.pose_kernels import fit_kernel, twist_at

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Single = NDArray[np.float32]
Views = NDArray[np.uint16]
Whole = NDArray[np.int64]

_INLIER_PX = 1.5  # a patch found farther from its landmark shows something else
_AGREE = 0.6  # least share of the coarse landmarks that fit one pose
_LEAST_FOUND = 8  # landmarks of a pose
_LIKENESS = 0.7  # least correlation of a patch with the image
_COARSE = 20  # landmarks of the image before that correct the predicted pose
_COARSE_FIRST, _COARSE_LAST = 3, 1  # levels; 4 px of 1/8 of the size are 32
_FINE_FIRST, _FINE_LAST = 1, 0  # from 0 on, dev_walk is better by 7 %, and compressed images are worse by 15 to 120 %
_FADES = 0.998  # share of a landmark's trust that is left an image later
_LATEST_SHARE = 0.2  # of the latest image in it


@kernel(
    "(f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], u1[::1], u1[::1], i8[:, ::1], f8[:, ::1], i8[::1], f8[:, ::1],"
    " f8[:, ::1], f8[:, ::1], f8[::1])",
)
def correct_prediction(
    lens: Array,
    predicted: Array,
    motion: Array,
    world_T_previous: Array,
    image: Bytes,
    image_before: Bytes,
    levels: Whole,
    world_T_before: Array,
    rows_before: Whole,
    pixels_before: Array,
    points_world: Array,
    normals: Array,
    fit: Array,
) -> tuple[Array, bool]:
    """A predicted pose corrected by some landmarks of the image before, each by its patch in that image (A eq. 2).

    Args:
        lens: of the camera.
        predicted: (4, 4) pose.
        motion, world_T_previous: (20,) or none, and (4, 4), of the rows' read-out.
        image, image_before, levels: (bytes,) pyramids of the two images, and (levels, 3) of both.
        world_T_before: (4, 4) pose of the image before.
        rows_before, pixels_before: (N,) its landmarks, and (N, 2) their places in it.
        points_world, normals: (L, 3) of the map's landmarks.
        fit: (4,) settings, as of ``fit_numbers``.

    Returns:
        (4, 4) the pose, and whether enough landmarks agree with it.
    """
    count = min(_COARSE, len(rows_before))
    rows, shown = np.empty(count, np.int64), np.empty((count, 2))
    for n in range(count):
        at = n * (len(rows_before) - 1) // max(count - 1, 1)
        rows[n], shown[n] = rows_before[at], pixels_before[at]
    pixels, likeness = align_patches(
        lens,
        predicted,
        twist_at(predicted, motion, world_T_previous),
        motion[0] if len(motion) else 0.0,
        image,
        levels,
        lens.copy().reshape((1, len(lens))),
        np.zeros(1, np.uint16),
        world_T_before.copy().reshape((1, 4, 4)),
        image_before.reshape((1, len(image_before))),
        levels.copy().reshape((1, len(levels), 3)),
        np.zeros(count, np.int64),
        shown,
        _taken(points_world, rows),
        _taken(normals, rows),
        _COARSE_FIRST,
        _COARSE_LAST,
        _LIKENESS,
    )
    found = np.flatnonzero(np.isfinite(likeness))
    if len(found) < _LEAST_FOUND:
        return predicted, False
    pose, _, _, inliers, _, _, _ = _fitted(
        lens, points_world, rows, pixels, found, predicted, motion, world_T_previous, fit
    )
    return pose, inliers.sum() >= max(float(_LEAST_FOUND), _AGREE * len(found))


@kernel(
    "(f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], f4[:, ::1], f4[::1], i8, f8[:, ::1], f8[:, ::1],"
    " u2[::1], f8[:, :, ::1], i8[::1], u2[::1])",
)
def choose_views(
    lens: Array,
    gains: Array,
    scales: Array,
    near: Array,
    motion: Array,
    world_T_previous: Array,
    surfaces: Single,
    trust: Single,
    per_cell: int,
    points_world: Array,
    reference_scales: Array,
    camera_of_view: Views,
    world_T_reference: Array,
    first_observation: Whole,
    observation_view: Views,
) -> tuple[Whole, Whole]:
    """Rows (N,) of the landmarks to look for around a pose, and the photograph (N,) for each; -1 where there is none.

    Args:
        lens, gains, scales: of the camera; see ``radial_gains`` and ``local_scales``.
        near: (4, 4) the pose.
        motion, world_T_previous: as of ``correct_prediction``.
        surfaces, trust, per_cell: as of ``choose_landmarks``.
        points_world: (L, 3) of the map's landmarks.
        reference_scales, camera_of_view, world_T_reference, first_observation, observation_view: as of ``best_views``.
    """
    twist, readout_time = twist_at(near, motion, world_T_previous), motion[0] if len(motion) else 0.0
    rows = choose_landmarks(lens, gains, near, twist, readout_time, surfaces, trust, per_cell)
    views = best_views(
        scales,
        near,
        points_world,
        rows,
        reference_scales,
        camera_of_view,
        world_T_reference,
        first_observation,
        observation_view,
    )
    return rows, views


@kernel(
    "(f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], u1[::1], i8[:, ::1], f8[:, ::1], u2[::1], f8[:, :, ::1], u1[:, ::1],"
    " i8[:, :, ::1], i8[::1], i8[::1], f8[:, ::1], f8[:, ::1], f4[::1], f8[::1])",
)
def find_landmarks(
    lens: Array,
    near: Array,
    motion: Array,
    world_T_previous: Array,
    image: Bytes,
    levels: Whole,
    reference_lenses: Array,
    camera_of_view: Views,
    world_T_reference: Array,
    references: Bytes,
    reference_levels: Whole,
    rows: Whole,
    views: Whole,
    points_world: Array,
    normals: Array,
    trust: Single,
    fit: Array,
) -> tuple[bool, Array, Array, Whole, Array, Array, float]:
    """Landmarks found by their photographs around a pose, and the pose fitted to them (A eq. 8, first term).

    Args:
        lens, near, motion, world_T_previous: as of ``choose_views``.
        image, levels: (bytes,) pyramid of the image, and (levels, 3) of it.
        reference_lenses, camera_of_view, world_T_reference, references, reference_levels: as of ``align_patches``.
        rows, views: of ``choose_views``.
        points_world, normals: (L, 3) of the map's landmarks.
        trust: (L,) how often each was found; brought up to date if a pose is.
        fit: (4,) settings, as of ``fit_numbers``.

    Returns:
        Whether there is a pose; the pose (4, 4) and its information (6, 6); rows (M,), pixels (M, 2) and shifts (M, 2)
        of the landmarks that agree with it; and their share of those that were looked for.
    """
    readout_time = motion[0] if len(motion) else 0.0
    pixels, likeness = align_patches(
        lens,
        near,
        twist_at(near, motion, world_T_previous),
        readout_time,
        image,
        levels,
        reference_lenses,
        camera_of_view,
        world_T_reference,
        references,
        reference_levels,
        views,
        np.zeros((0, 2)),
        _taken(points_world, rows),
        _taken(normals, rows),
        _FINE_FIRST,
        _FINE_LAST,
        _LIKENESS,
    )
    found = np.flatnonzero(np.isfinite(likeness))
    nothing, none = np.zeros((0, 2)), rows[:0].copy()
    if len(found) < _LEAST_FOUND:
        return False, near, np.zeros((6, 6)), none, nothing, nothing, 0.0
    pose, information, errors_px, _, shifts, _, _ = _fitted(
        lens, points_world, rows, pixels, found, near, motion, world_T_previous, fit
    )
    inliers = np.flatnonzero(errors_px < _INLIER_PX)
    if len(inliers) < _LEAST_FOUND:
        return False, near, information, none, nothing, nothing, 0.0
    for i in range(len(trust)):
        trust[i] *= np.float32(_FADES)
    agree = np.zeros(len(rows), np.bool_)
    agree[found[inliers]] = True
    looked_for = 0
    for n in range(len(rows)):
        looked_for += views[n] >= 0
        latest = np.float32(0.5) if agree[n] else np.float32(-0.5)
        trust[rows[n]] += np.float32(_LATEST_SHARE) * (latest - trust[rows[n]])
    chosen = found[inliers]
    return (
        True,
        pose,
        information,
        rows[chosen],
        _taken(pixels, chosen),
        _taken(shifts, inliers),
        len(inliers) / looked_for,
    )


@kernel()
def _fitted(
    lens: Array,
    points_world: Array,
    rows: Whole,
    pixels: Array,
    found: Whole,
    start: Array,
    motion: Array,
    world_T_previous: Array,
    fit: Array,
) -> tuple[Array, Array, Array, NDArray[np.bool_], Array, float, float]:
    """``fit_kernel`` on the landmarks (found) of some rows."""
    shown, shares = _taken(pixels, found), np.empty(len(found) if len(motion) else 0)
    for n in range(len(shares)):
        shares[n] = shown[n, 1] / (lens[2] - 1.0) - 0.5
    points = _taken(points_world, rows[found])
    return fit_kernel(lens, points, shown, start, fit[0], fit[1], fit[2], int(fit[3]), shares, motion, world_T_previous)


@kernel()
def _taken(values: Array, rows: Whole) -> Array:
    """Rows (N, C) of an array."""
    taken = np.empty((len(rows), values.shape[1]))
    for n in range(len(rows)):
        for k in range(values.shape[1]):
            taken[n, k] = values[rows[n], k]
    return taken
