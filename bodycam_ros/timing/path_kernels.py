"""Points of ``camera_path``'s curve as kernels."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry_kernels import compose, exp_se3, inverse, log_se3
from bodycam_ros.kernels import kernel

Array = NDArray[np.float64]

# Sigma half-way between two images, per third difference: images of a walk that are left out are off by 0.9 to 1.6 of
# it, by 2.5 where the torso shakes.
_OF_THIRD_DIFFERENCE = 0.1


@kernel("(i8[::1], f8[:, :, ::1], i8[::1], f8)")
def points_on_curve(
    images_ns: NDArray[np.int64], world_T_camera: Array, stamps_ns: NDArray[np.int64], max_gap_s: float
) -> tuple[NDArray[np.int64], Array, Array, Array, NDArray[np.int64]]:
    """The fields of ``PathPoints`` by two images or more; as ``path_points`` otherwise."""
    gaps_s, means, by_image = _between_images(images_ns, world_T_camera)
    wanted, last = len(stamps_ns), len(gaps_s) - 1
    rows = np.empty(wanted, np.int64)
    nearest = np.empty(wanted, np.int64)
    count = 0
    poses = np.empty((wanted, 4, 4))
    variances = np.zeros((wanted, 6))
    twists = np.empty((wanted, 6))
    for row in range(wanted):
        k = min(max(np.searchsorted(images_ns, stamps_ns[row], side="right") - 1, 0), last)
        gap_s = gaps_s[k]
        s = 1e-9 * (stamps_ns[row] - images_ns[k]) / gap_s
        if not (s == 0.0 or s == 1.0 or (0.0 < s < 1.0 and gap_s <= max_gap_s)):
            continue
        curve = np.empty(6)
        for i in range(6):
            step = gap_s * means[k, i]
            start = gap_s * by_image[k, i]
            end = gap_s * by_image[k + 1, i]
            curve[i] = s * (start + s * (3.0 * step - 2.0 * start - end + s * (start + end - 2.0 * step)))
            # The curve's own slope shares its errors with the curve: clock offsets by it are off by milliseconds.
            twists[count, i] = (1.0 - s) * by_image[k, i] + s * by_image[k + 1, i]
        if 0 < k < last:
            sigma = _OF_THIRD_DIFFERENCE * 4.0 * s * (1.0 - s) * gap_s
            for i in range(6):
                # Rotation and translation each have a mean over their axes.
                third = means[k + 1, i] - 2.0 * means[k, i] + means[k - 1, i]
                variances[count, i // 3 * 3 : i // 3 * 3 + 3] += (sigma * third) ** 2 / 3.0
        poses[count] = compose(world_T_camera[k], exp_se3(curve))
        rows[count], nearest[count] = row, k + (1 if s >= 0.5 else 0)
        count += 1
    return rows[:count], poses[:count], variances[:count], twists[:count], nearest[:count]


@kernel()
def _between_images(images_ns: NDArray[np.int64], world_T_camera: Array) -> tuple[Array, Array, Array]:
    """Lengths (N-1) [s] of the intervals and mean twists (N-1, 6); the twists at the images (N, 6).

    At the ends these are those of the outer intervals.
    """
    count = len(images_ns) - 1
    gaps_s, means = np.empty(count), np.empty((count, 6))
    for k in range(count):
        gaps_s[k] = 1e-9 * (images_ns[k + 1] - images_ns[k])
        means[k] = log_se3(compose(inverse(world_T_camera[k]), world_T_camera[k + 1])) / gaps_s[k]
    by_image = np.empty((count + 1, 6))
    by_image[0], by_image[count] = means[0], means[count - 1]
    for k in range(1, count):
        first, second = gaps_s[k - 1], gaps_s[k]
        by_image[k] = (second * means[k - 1] + first * means[k]) / (first + second)
    return gaps_s, means, by_image
