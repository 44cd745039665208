"""Trajectories between their stamps, and the nearest of these."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, rigid, rotation_between


def interpolated(stamps_ns: NDArray[np.int64], poses: Array, at_ns: NDArray[np.int64]) -> Array:
    """Poses (N, 4, 4) at stamps (N,) within a trajectory (K, 4, 4) known at stamps (K,), two or more, increasing [ns].

    Between two states the position goes straight and the rotation about one axis, both at constant speed.
    """
    before = np.clip(np.searchsorted(stamps_ns, at_ns, side="right") - 1, 0, len(stamps_ns) - 2)
    share = ((at_ns - stamps_ns[before]) / (stamps_ns[before + 1] - stamps_ns[before]))[:, None]
    start, end = poses[before], poses[before + 1]
    position = (1.0 - share) * start[:, :3, 3] + share * end[:, :3, 3]
    return rigid(rotation_between(start[:, :3, :3], end[:, :3, :3], share), position)


def pose_near(stamps_ns: NDArray[np.int64], poses: Array, at_ns: int) -> Array:
    """Pose (4, 4) of a trajectory (K, 4, 4) at a time [ns]; outside its stamps (K,), that of the nearest end."""
    if len(stamps_ns) == 1:
        return np.asarray(poses[0])
    return np.asarray(interpolated(stamps_ns, poses, np.clip(np.array([at_ns]), stamps_ns[0], stamps_ns[-1]))[0])


def between_neighbours(stamps_ns: NDArray[np.int64], at_ns: NDArray[np.int64], longest_ns: float) -> NDArray[np.bool_]:
    """(N,) whether a stamp (N,) lies within a trajectory's stamps (K,), in a step no longer than ``longest_ns``."""
    if len(stamps_ns) < 2:
        return np.zeros(len(at_ns), dtype=bool)
    inside = (at_ns >= stamps_ns[0]) & (at_ns <= stamps_ns[-1])
    before = np.clip(np.searchsorted(stamps_ns, at_ns, side="right") - 1, 0, len(stamps_ns) - 2)
    near: NDArray[np.bool_] = inside & (stamps_ns[before + 1] - stamps_ns[before] <= longest_ns)
    return near


def nearest(stamps_ns: NDArray[np.int64], at_ns: int, within_ns: int) -> int | None:
    """Row of the stamp (K,) nearest to a time, if there is one so near."""
    if not len(stamps_ns):
        return None
    row = int(np.argmin(np.abs(stamps_ns - at_ns)))
    return row if abs(int(stamps_ns[row]) - at_ns) <= within_ns else None


def nearest_rows(stamps_ns: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    """(N,) row of the stamp (K,), which increase, nearest to each time (N,)."""
    after = np.clip(np.searchsorted(stamps_ns, at_ns), 1, len(stamps_ns) - 1)
    return np.where(at_ns - stamps_ns[after - 1] < stamps_ns[after] - at_ns, after - 1, after)


def distance_in_time(stamps_ns: NDArray[np.int64], others_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) distance [ns] of each stamp (K,) to the nearest of others (T,), which increase; the largest without any."""
    if not len(others_ns):
        return np.full(len(stamps_ns), np.iinfo(np.int64).max)
    distance: NDArray[np.int64] = np.abs(others_ns[nearest_rows(others_ns, stamps_ns)] - stamps_ns)
    return distance
