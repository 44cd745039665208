"""Errors of an estimated motion against the true one, one function per measure, and how values are spread.

T instants, S segments. The measures are those of A section 5.1, and two that mend what those cannot see: the absolute
scale, and rotations about a changing axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, log_so3, nearest_rotation, umeyama

ALTERNATIONS = 50
"""Steps of the alternating fit of constant frames; it has converged to rounding long before."""


@dataclass(frozen=True)
class Distribution:
    """Mean, median, 95th percentile and maximum; NaN of no values."""

    mean: float
    median: float
    p95: float
    max: float

    @classmethod
    def of(cls, values: NDArray[np.floating]) -> "Distribution":
        """The distribution of values of any shape; those that are NaN do not count."""
        known = values[np.isfinite(values)]
        if not known.size:
            return cls(np.nan, np.nan, np.nan, np.nan)
        return cls(float(known.mean()), float(np.median(known)), float(np.percentile(known, 95)), float(known.max()))


def coverage(true_stamps_ns: NDArray[np.int64], solved_stamps_ns: NDArray[np.int64], frame_ns: float) -> float:
    """Share of the true frames (K,) that have a solved instant (T,) within half a frame."""
    return float(np.mean(distance_in_time(true_stamps_ns, solved_stamps_ns) <= frame_ns / 2.0))


def distance_in_time(stamps_ns: NDArray[np.int64], others_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) distance [ns] of each stamp (K,) to the nearest of others (T,), which increase."""
    after = np.searchsorted(others_ns, stamps_ns)
    next_one = others_ns[np.minimum(after, len(others_ns) - 1)]
    one_before = others_ns[np.maximum(after - 1, 0)]
    distance: NDArray[np.int64] = np.minimum(np.abs(next_one - stamps_ns), np.abs(stamps_ns - one_before))
    return distance


def alignment(estimated: Array, true: Array, with_scale: bool) -> tuple[float, Array, Array]:
    """Scale s, true_R_estimated (3, 3), t (3,) of a whole recording that bring s R estimated + t closest to true.

    A 5.1, "similarity transform from the SfM space to the motion capture space"; without scale if the map is metric.

    Args:
        estimated: (T, S, 3) positions of joints [m].
        true: (T, S, 3) the same joints [m].
    """
    return umeyama(estimated.reshape(-1, 3), true.reshape(-1, 3), with_scale)


def position_errors(estimated: Array, true: Array, scale: float, R: Array, t: Array) -> Array:
    """|s R estimated + t - true| (T, S) [m] of positions (T, S, 3) after an ``alignment`` (A figure 7b)."""
    errors: Array = np.linalg.norm(scale * estimated @ R.T + t - true, axis=-1)
    return errors


def tilt(true_R_estimated: Array) -> float:
    """Angle [rad] between the map's z axis and true up."""
    return float(np.arccos(np.clip(true_R_estimated[2, 2], -1.0, 1.0)))


def angle_errors(estimated: Array, true: Array) -> Array:
    """| |log(E_0' E_t)| - |log(T_0' T_t)| | (T,) [rad] of rotations of child in parent (T, 3, 3).

    A figure 7a: "the angle of the axis-angle representation normalized by the angle of the first frame". Blind to the
    axis, and at the mercy of the first frame: ``rotation_errors`` is neither.
    """
    errors: Array = np.abs(turned(estimated) - turned(true))
    return errors


def fit_constant_frames(estimated: Array, true: Array) -> tuple[Array, Array]:
    """Constant rotations A, B (3, 3) that bring A true_t B closest to estimated_t, in the chordal sense.

    Where one says that a segment's axes are is a convention: A is that of the parent, B that of the child. Alternating
    least squares: given one, the other is the mean of the rotations that remain.

    Args:
        estimated: (T, 3, 3) rotation of child in parent.
        true: (T, 3, 3) the same.
    """
    A, B = np.eye(3), np.eye(3)
    for _ in range(ALTERNATIONS):
        A = nearest_rotation(np.mean(estimated @ _transposed(true @ B), axis=0))
        B = nearest_rotation(np.mean(_transposed(A @ true) @ estimated, axis=0))
    return A, B


def rotation_errors(estimated: Array, true: Array, A: Array, B: Array) -> Array:
    """|log(A true_t B estimated_t')| (T,) [rad]: the geodesic error once constant frames are fitted."""
    return _angle(A @ true @ B @ _transposed(estimated))


def turned(rotations: Array) -> Array:
    """By how much (T,) [rad] rotations (T, 3, 3) have turned since the first (A figure 7a)."""
    return _angle(_transposed(rotations[:1]) @ rotations)


def _angle(R: Array) -> Array:
    angle: Array = np.linalg.norm(log_so3(R), axis=-1)
    return angle


def _transposed(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)
