"""The window of poses that is still being solved: gtsam's incremental fixed-lag smoother, and a plain check of it.

``IncrementalBackEnd`` re-eliminates only what a new frame touches (iSAM2, Kaess et al. 2012) and marginalises what
leaves the window. ``BatchBackEnd`` solves the whole window anew by Levenberg-Marquardt, as seed A does (A 4.3); it
is slower and serves to check the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Protocol

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.solving.motion import orthonormal

Key = int


class BackEndError(Exception):
    """The back end cannot solve its window, or solved it to nonsense; it must be begun anew."""


_SETTLING_UPDATES = 4
"""Gauss-Newton converges quadratically from where one step has brought it."""


class BackEnd(Protocol):
    """What the smoother needs of a solver; every method raises BackEndError when it cannot."""

    def update(
        self, factors: gtsam.NonlinearFactorGraph, poses: Mapping[Key, NDArray[np.float64]], stamp_s: float
    ) -> None:
        """Add one instant's factors and the start values (4, 4) of its poses; drop what is older than the lag."""

    def settle(self) -> None:
        """Iterate until nothing moves any more; for the last instants, which no later update will improve."""

    def poses(self, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Estimates (K, 4, 4) of poses within the window."""


class IncrementalBackEnd:
    """iSAM2 over a sliding window.

    Args:
        lag_s: length of the window [s].
        extra_updates: further Gauss-Newton steps after the one that adds a frame.
        relinearize_threshold: change of a pose [rad, m] beyond which its factors are linearised anew.
    """

    def __init__(self, lag_s: float, extra_updates: int, relinearize_threshold: float) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(relinearize_threshold)
        parameters.relinearizeSkip = 1
        # The lag smoother removes factors as they leave; their slots are used again, or memory would grow with time.
        parameters.findUnusedFactorSlots = True
        self._smoother = gtsam.IncrementalFixedLagSmoother(lag_s, parameters)
        self._extra_updates = extra_updates

    def update(
        self, factors: gtsam.NonlinearFactorGraph, poses: Mapping[Key, NDArray[np.float64]], stamp_s: float
    ) -> None:
        """Add one instant's factors and poses."""
        with _failures():
            self._smoother.update(factors, _values(poses), _stamps(poses, stamp_s))
        self._iterate(self._extra_updates)

    def settle(self) -> None:
        """Iterate a few times more."""
        self._iterate(_SETTLING_UPDATES)

    def _iterate(self, count: int) -> None:
        with _failures():
            for _ in range(count):
                self._smoother.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), {})

    def poses(self, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Estimates (K, 4, 4)."""
        with _failures():
            return _checked([self._smoother.calculateEstimatePose3(key).matrix() for key in keys])


class BatchBackEnd:
    """Levenberg-Marquardt over a sliding window.

    Args:
        lag_s: length of the window [s].
    """

    def __init__(self, lag_s: float) -> None:
        self._smoother = gtsam.BatchFixedLagSmoother(lag_s, gtsam.LevenbergMarquardtParams())
        self._values = gtsam.Values()

    def update(
        self, factors: gtsam.NonlinearFactorGraph, poses: Mapping[Key, NDArray[np.float64]], stamp_s: float
    ) -> None:
        """Add one instant's factors and poses."""
        with _failures():
            self._smoother.update(factors, _values(poses), _stamps(poses, stamp_s))
            self._values = self._smoother.calculateEstimate()

    def settle(self) -> None:
        """Nothing to do: every update iterates until it has converged."""

    def poses(self, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Estimates (K, 4, 4)."""
        with _failures():
            return _checked([self._values.atPose3(key).matrix() for key in keys])


@contextmanager
def _failures() -> Iterator[None]:
    """Gtsam's exceptions, which are RuntimeError, IndexError or ValueError as it happens, as ours."""
    try:
        yield
    except (RuntimeError, IndexError, ValueError) as error:
        raise BackEndError(str(error).strip().splitlines()[0] if str(error).strip() else repr(error)) from error


def _checked(poses: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Poses (K, 4, 4) with rotations put back onto SO(3).

    Raises:
        BackEndError: they are not finite.
    """
    stacked = np.stack(poses)
    if not np.isfinite(stacked).all():
        raise BackEndError("the solution is not finite")
    return orthonormal(stacked)


def _values(poses: Mapping[Key, NDArray[np.float64]]) -> gtsam.Values:
    values = gtsam.Values()
    for key, pose in poses.items():
        values.insert(key, gtsam.Pose3(pose))
    return values


def _stamps(poses: Mapping[Key, NDArray[np.float64]], stamp_s: float) -> dict[Key, float]:
    return dict.fromkeys(poses, stamp_s)
