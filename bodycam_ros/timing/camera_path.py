"""A path through a camera's registered poses.

Between two images the pose is ``first @ exp(h(s))``, ``h`` a cubic Hermite curve of tangent vectors whose slopes at
both ends are the twists there, each from the parabola through three images (Kim et al. 1995 do so with quaternions).
At 24 images a second, in swings of 1 to 3 Hz that reach 100 rad/s^2, it is off by up to 0.14 deg, a line by 1.2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.kernels import as_rows
from bodycam_ros.timing.path_kernels import points_on_curve


@dataclass(frozen=True, eq=False)
class PathPoints:
    """Points of a path at K of some stamps.

    Attributes:
        rows: (K) of these among the stamps.
        poses: (K, 4, 4).
        variances: (K, 6) of the curve [rad^2], [m^2]: 0 at an image, and where none is on either side of the two.
        twists: (K, 6) rotation [rad/s] then translation [m/s], in the camera's axes; between images those of the images
            by their shares.
        nearest: (K) rows of the nearest images.
    """

    rows: NDArray[np.intp]
    poses: Array
    variances: Array
    twists: Array
    nearest: NDArray[np.intp]


def path_points(
    images_ns: NDArray[np.int64], world_T_camera: Array, stamps_ns: NDArray[np.int64], max_gap_s: float
) -> PathPoints:
    """Points of a camera's path, at the stamps of images and between two that are close to each other.

    Args:
        images_ns: (N) stamps of the images, ascending [ns].
        world_T_camera: (N, 4, 4) their poses.
        stamps_ns: (T) wanted [ns].
        max_gap_s: between two images.
    """
    if len(images_ns) == 1:
        images_ns, world_T_camera = images_ns + np.array([0, 1 << 62]), np.repeat(world_T_camera, 2, axis=0)
    return PathPoints(*points_on_curve(images_ns, as_rows(world_T_camera), stamps_ns, max_gap_s))
