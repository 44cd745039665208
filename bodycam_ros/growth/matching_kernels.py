"""Which features of two registered images are alike and may show one point: see ``keyframe_matching``."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels.kernel import kernel

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

_FARTHEST = 1 << 30  # squared distance that no two descriptors have
_BLOCK = 32  # entries of a descriptor between two looks at whether it can still be among the nearest


@kernel("(u1[:, ::1], u1[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8)")
def match_along_epipolar_lines(
    first_descriptors: NDArray[np.uint8],
    second_descriptors: NDArray[np.uint8],
    first_rays: Array,
    second_rays: Array,
    baseline: Array,
    tolerance: float,
) -> tuple[Whole, Whole, Whole]:
    """For every feature of an image the most similar one of another whose ray may meet its own before both.

    Args:
        first_descriptors, second_descriptors: (A, 128), (B, 128).
        first_rays, second_rays: (A, 3), (B, 3) unit, in the world.
        baseline: (3,) unit, from the first image to the second.
        tolerance: sine of the angle by which a ray may lie beside the plane of the other and the baseline.

    Returns:
        The other image's feature (A,), -1 where there is none or that one has a more similar partner; squared distance
        (A,) to it; and to the second most similar (A,).
    """
    count, others = len(first_rays), len(second_rays)
    along = np.empty(others)
    for j in range(others):
        along[j] = baseline[0] * second_rays[j, 0] + baseline[1] * second_rays[j, 1] + baseline[2] * second_rays[j, 2]
    nearest = np.full(count, -1, np.int64)
    best = np.full(count, _FARTHEST, np.int64)
    rival = np.full(count, _FARTHEST, np.int64)
    best_of_other = np.full(others, _FARTHEST, np.int64)
    nearest_of_other = np.full(others, -1, np.int64)
    for i in range(count):
        x, y, z = first_rays[i, 0], first_rays[i, 1], first_rays[i, 2]
        along_first = baseline[0] * x + baseline[1] * y + baseline[2] * z
        # Across the baseline, in the plane of ray and baseline; and the normal of that plane.
        across_x, across_y, across_z = (
            x - along_first * baseline[0],
            y - along_first * baseline[1],
            z - along_first * baseline[2],
        )
        length = np.sqrt(across_x**2 + across_y**2 + across_z**2)
        if length < 1e-9:
            continue
        across_x, across_y, across_z = across_x / length, across_y / length, across_z / length
        normal_x = across_y * baseline[2] - across_z * baseline[1]
        normal_y = across_z * baseline[0] - across_x * baseline[2]
        normal_z = across_x * baseline[1] - across_y * baseline[0]
        for j in range(others):
            u, v, w = second_rays[j, 0], second_rays[j, 1], second_rays[j, 2]
            if abs(normal_x * u + normal_y * v + normal_z * w) >= tolerance:
                continue
            # They meet where the second is turned farther from the baseline than the first, to the same side.
            if along[j] >= along_first or across_x * u + across_y * v + across_z * w <= 0.0:
                continue
            limit = max(rival[i], best_of_other[j])
            squared = np.int64(0)
            for start in range(0, first_descriptors.shape[1], _BLOCK):
                for k in range(start, min(start + _BLOCK, first_descriptors.shape[1])):
                    difference = np.int64(first_descriptors[i, k]) - np.int64(second_descriptors[j, k])
                    squared += difference * difference
                if squared >= limit:
                    break
            if squared < best[i]:
                rival[i], best[i], nearest[i] = best[i], squared, j
            elif squared < rival[i]:
                rival[i] = squared
            if squared < best_of_other[j]:
                best_of_other[j], nearest_of_other[j] = squared, i
    for i in range(count):
        if nearest[i] >= 0 and nearest_of_other[nearest[i]] != i:
            nearest[i] = -1
    return nearest, best, rival
