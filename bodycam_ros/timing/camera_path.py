"""A path through a camera's registered poses.

Between two images the pose is ``first @ exp(h(s))``, ``h`` a cubic Hermite curve of tangent vectors whose slopes at
both ends are the twists there, each from the parabola through three images (Kim et al. 1995 do so with quaternions).
At 24 images a second, in swings of 1 to 3 Hz that reach 100 rad/s^2, it is off by up to 0.14 deg, a line by 1.2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3

# Sigma half-way between two images, per third difference: images of a walk that are left out are off by 0.9 to 1.6 of
# it, by 2.5 where the torso shakes.
_OF_THIRD_DIFFERENCE = 0.1


@dataclass(frozen=True, eq=False)
class PathPoints:
    """Points of a path.

    Attributes:
        poses: (K, 4, 4).
        variances: (K, 6) of the curve [rad^2], [m^2]: 0 at an image, and where none is on either side of the two.
        twists: (K, 6) rotation [rad/s] then translation [m/s], in the camera's axes; between images those of the images
            by their shares.
        before: (K) row of the image before, or of the image itself.
        shares: (K) how far from that image to the next, 0 to 1.
    """

    poses: Array
    variances: Array
    twists: Array
    before: NDArray[np.intp]
    shares: Array

    @property
    def nearest(self) -> NDArray[np.intp]:
        """(K) row of the nearest image."""
        return self.before + (self.shares >= 0.5)


class CameraPath:
    """A path through registered poses.

    Args:
        stamps_ns: (N) of the images, ascending [ns].
        world_T_camera: (N, 4, 4) their poses.
    """

    def __init__(self, stamps_ns: NDArray[np.int64], world_T_camera: Array) -> None:
        self.stamps_ns = stamps_ns
        self.world_T_camera = world_T_camera
        self._gaps_s = 1e-9 * np.diff(stamps_ns).astype(np.float64)
        self._steps = log_se3(inverse(world_T_camera[:-1]) @ world_T_camera[1:])
        self._twists = _twists(self._steps, self._gaps_s)
        self._bends = _bends(self._steps, self._gaps_s)

    def covers(self, stamps_ns: NDArray[np.int64], max_gap_s: float) -> NDArray[np.bool_]:
        """Which stamps (K) are those of an image, or lie between two that are at most ``max_gap_s`` apart."""
        after = np.searchsorted(self.stamps_ns, stamps_ns)
        exact = self.stamps_ns[np.minimum(after, len(self.stamps_ns) - 1)] == stamps_ns
        between = (after > 0) & (after < len(self.stamps_ns))
        close = np.zeros(len(stamps_ns), bool)
        close[between] = self._gaps_s[after[between] - 1] <= max_gap_s
        covered: NDArray[np.bool_] = exact | close
        return covered

    def interpolate(self, stamps_ns: NDArray[np.int64]) -> PathPoints:
        """The path at stamps (K) between its first image and its last [ns]."""
        before = np.clip(np.searchsorted(self.stamps_ns, stamps_ns, side="right") - 1, 0, len(self.stamps_ns) - 1)
        if len(self.stamps_ns) == 1:
            still = np.zeros((len(before), 6))
            return PathPoints(self.world_T_camera[before], still, still, before, np.zeros(len(before)))
        start = np.minimum(before, len(self._gaps_s) - 1)
        gaps_s = self._gaps_s[start][:, None]
        s = 1e-9 * (stamps_ns - self.stamps_ns[start]).astype(np.float64)[:, None] / gaps_s
        step, first, last = self._steps[start], gaps_s * self._twists[start], gaps_s * self._twists[start + 1]
        curve = s * first + s**2 * (3 * step - 2 * first - last) + s**3 * (first + last - 2 * step)
        # The curve's own slope shares its errors with the curve: clock offsets by it are off by milliseconds.
        twists = (1.0 - s) * self._twists[start] + s * self._twists[start + 1]
        sigmas = _OF_THIRD_DIFFERENCE * 4.0 * s * (1.0 - s) * self._bends[start]
        return PathPoints(self.world_T_camera[start] @ exp_se3(curve), sigmas**2, twists, start, s[:, 0])


def _twists(steps: Array, gaps_s: Array) -> Array:
    """Twists (N, 6) at the images, from the steps (N-1, 6) between them; at the ends those of the outer steps."""
    if not len(steps):
        return np.zeros((1, 6))
    means = steps / gaps_s[:, None]
    first, second = gaps_s[:-1, None], gaps_s[1:, None]
    inner = (second * means[:-1] + first * means[1:]) / (first + second)
    return np.concatenate([means[:1], inner, means[-1:]])


def _bends(steps: Array, gaps_s: Array) -> Array:
    """Third differences (N-1, 6) over the intervals, rms of rotation and of translation; 0 for the outer ones."""
    bends = np.zeros_like(steps)
    if len(steps) > 2:
        means = steps / gaps_s[:, None]
        thirds = gaps_s[1:-1, None] * np.diff(means, 2, axis=0)
        bends[1:-1] = np.repeat(np.sqrt((thirds.reshape(-1, 2, 3) ** 2).mean(axis=2)), 3, axis=1)
    return bends
