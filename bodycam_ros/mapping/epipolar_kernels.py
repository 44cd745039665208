"""The loop of ``epipolar_matching`` over the features of two images as a kernel."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]

_UNLIKE = 1 << 30  # more than the squared distance of any two descriptors
_LEAST_SINE = 0.05  # of a ray's angle to the baseline: nearer to it a pixel's error changes the predicted size


@kernel("(f8[:, ::1], f8[::1], u1[:, ::1], f8[:, ::1], f8[::1], u1[:, ::1], f8, f8, f8, f8)")
def match_along_epipolars(
    first_rays: Array,
    first_sizes: Array,
    first_descriptors: NDArray[np.uint8],
    second_rays: Array,
    second_sizes: Array,
    second_descriptors: NDArray[np.uint8],
    band: float,
    max_size_ratio: float,
    max_ratio: float,
    max_distance: float,
) -> NDArray[np.uint32]:
    """Pairs (M, 2) of features that are each other's likest among all whose rays may meet.

    Both rays of a point lie in one half-plane bounded by the baseline, and the one from farther along it leans back
    more. The law of sines gives the quotient of the point's distances, and so that of its feature's sizes.

    Args:
        first_rays, second_rays: (N, 3), (K, 3) unit rays in common axes whose z points from the first photograph's
            centre to the second's.
        first_sizes, second_sizes: (N,), (K,) angles that the features cover [rad].
        first_descriptors, second_descriptors: (N, 128), (K, 128).
        band: how far a ray may lie beside the plane of another [rad].
        max_size_ratio: of a feature's size to that which the other predicts, and its inverse.
        max_ratio: of the distance of descriptors to that to the second likest, either way.
        max_distance: of descriptors.
    """
    n, k = len(first_rays), len(second_rays)
    azimuths, angles = np.empty(n), np.empty(n)
    for i in range(n):
        azimuths[i] = math.atan2(first_rays[i, 1], first_rays[i, 0])
        angles[i] = math.acos(min(1.0, max(-1.0, first_rays[i, 2])))
    order = np.argsort(azimuths)
    azimuths = azimuths[order]

    first_best, first_next = np.full(n, _UNLIKE, np.int32), np.full(n, _UNLIKE, np.int32)
    second_best, second_next = np.full(k, _UNLIKE, np.int32), np.full(k, _UNLIKE, np.int32)
    first_partner, second_partner = np.full(n, -1, np.int32), np.full(k, -1, np.int32)
    for j in range(k):
        azimuth = math.atan2(second_rays[j, 1], second_rays[j, 0])
        angle = math.acos(min(1.0, max(-1.0, second_rays[j, 2])))
        sine = math.sin(angle)
        width = math.pi if sine <= band else math.asin(band / sine)
        for turn in range(-1, 2):
            low, high = azimuth - width + 2.0 * math.pi * turn, azimuth + width + 2.0 * math.pi * turn
            if high < -math.pi or low > math.pi:
                continue
            for position in range(np.searchsorted(azimuths, low), np.searchsorted(azimuths, high)):
                i = order[position]
                if angles[i] > angle + band:
                    continue
                first_sine = math.sin(angles[i])
                if sine > _LEAST_SINE and first_sine > _LEAST_SINE:
                    larger = first_sizes[i] * sine / (second_sizes[j] * first_sine)
                    if larger > max_size_ratio or larger * max_size_ratio < 1.0:
                        continue
                squared = np.int32(0)
                for c in range(first_descriptors.shape[1]):
                    difference = np.int32(first_descriptors[i, c]) - np.int32(second_descriptors[j, c])
                    squared += difference * difference
                if squared < second_best[j]:
                    second_next[j], second_best[j], second_partner[j] = second_best[j], squared, i
                elif squared < second_next[j]:
                    second_next[j] = squared
                if squared < first_best[i]:
                    first_next[i], first_best[i], first_partner[i] = first_best[i], squared, j
                elif squared < first_next[i]:
                    first_next[i] = squared

    pairs = np.empty((k, 2), np.uint32)
    found = 0
    for j in range(k):
        i = second_partner[j]
        if i < 0 or first_partner[i] != j or second_best[j] > max_distance * max_distance:
            continue
        if second_best[j] > max_ratio * max_ratio * min(second_next[j], first_next[i]):
            continue
        pairs[found, 0], pairs[found, 1] = i, j
        found += 1
    return pairs[:found].copy()
