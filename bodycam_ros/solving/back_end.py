"""The window of poses that is still being solved: gtsam's iSAM2 over a sliding window, and a plain check of it.

``IncrementalBackEnd`` re-eliminates only what a new instant touches (iSAM2, Kaess et al. 2012) and marginalises what
leaves the window. ``BatchBackEnd`` solves the whole window anew by Levenberg-Marquardt, as seed A does (A 4.3); it
is slower and serves to check the other.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
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


@dataclass
class _Block:
    """Instants that are eliminated, and leave the window, together."""

    start_s: float
    latest_s: float
    keys: list[Key] = field(default_factory=list)


class IncrementalBackEnd:
    """iSAM2 over a sliding window that is eliminated in the order of time.

    So the oldest poses are leaves of the Bayes tree and are marginalised as they are, and a new instant touches its
    neighbour alone. gtsam's own ``IncrementalFixedLagSmoother`` leaves the order to COLAMD, and must eliminate the
    whole window anew at every instant before its oldest poses can go.

    Args:
        lag_s: length of the window [s].
        extra_updates: further Gauss-Newton steps after the one that adds a frame.
        relinearize_threshold: change of a pose [rad, m] beyond which its factors are linearised anew.
    """

    def __init__(self, lag_s: float, extra_updates: int, relinearize_threshold: float) -> None:
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(relinearize_threshold)
        parameters.relinearizeSkip = 1
        # Factors go as their poses leave; their slots are used again, or memory would grow with time.
        parameters.findUnusedFactorSlots = True
        self._smoother = gtsam.ISAM2(parameters)
        self._lag_s = lag_s
        self._extra_updates = extra_updates
        self._blocks: deque[_Block] = deque()
        self._estimates: tuple[Key, NDArray[np.float64]] | None = None

    def update(
        self, factors: gtsam.NonlinearFactorGraph, poses: Mapping[Key, NDArray[np.float64]], stamp_s: float
    ) -> None:
        """Add one instant's factors and poses."""
        self._estimates = None
        with back_end_failures():
            self._enter(list(poses), stamp_s, most_blocks=factors.keys().size())
            self._smoother.update(factors, _values(poses), [], self._order())
            # Not before: the new factors may tie the instant to the oldest ones.
            self._marginalise(stamp_s - self._lag_s)
        for _ in range(self._extra_updates):
            self._iterate()

    def settle(self) -> None:
        """Iterate a few times more."""
        for _ in range(_SETTLING_UPDATES):
            self._iterate()

    def poses(self, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Estimates (K, 4, 4)."""
        with back_end_failures():
            if self._estimates is None:
                self._estimates = all_poses(self._smoother.calculateEstimate())
            return _chosen(self._estimates, keys)

    def _marginalise(self, before_s: float) -> None:
        """Let go what is older than a time, in whole blocks."""
        leaving = gtsam.KeyList()
        while len(self._blocks) > 1 and self._blocks[0].latest_s < before_s:
            for key in self._blocks.popleft().keys:
                leaving.push_back(key)
        if leaving.size():
            self._smoother.marginalizeLeaves(leaving)

    def _enter(self, keys: list[Key], stamp_s: float, most_blocks: int) -> None:
        """Put a new instant into a block: one of its own, unless there would be more than CCOLAMD can tell apart.

        It takes no more constraint sets than it orders variables; those are the keys of the new factors at least.
        """
        lasts_s = self._lag_s / max(1, most_blocks - 1)
        full = not self._blocks or stamp_s - self._blocks[-1].start_s >= lasts_s
        if full and len(self._blocks) < most_blocks:
            self._blocks.append(_Block(stamp_s, stamp_s))
        while len(self._blocks) > most_blocks:
            oldest = self._blocks.popleft()
            self._blocks[0].keys[:0] = oldest.keys
        self._blocks[-1].latest_s = stamp_s
        self._blocks[-1].keys += keys

    def _order(self) -> gtsam.KeyGroupMap:
        """Every variable's place in the order of elimination."""
        order = gtsam.KeyGroupMap()
        for place, block in enumerate(self._blocks):
            for key in block.keys:
                order.insert2(key, place)
        return order

    def _iterate(self) -> None:
        """One more step over all variables: fewer might not be enough for the order to tell them apart."""
        self._estimates = None
        everything = gtsam.KeyList()
        for block in self._blocks:
            for key in block.keys:
                everything.push_back(key)
        with back_end_failures():
            self._smoother.update(
                gtsam.NonlinearFactorGraph(), gtsam.Values(), [], self._order(), None, everything, True
            )


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
        with back_end_failures():
            self._smoother.update(factors, _values(poses), _stamps(poses, stamp_s))
            self._values = self._smoother.calculateEstimate()

    def settle(self) -> None:
        """Nothing to do: every update iterates until it has converged."""

    def poses(self, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Estimates (K, 4, 4)."""
        with back_end_failures():
            return _chosen(all_poses(self._values), keys)


@contextmanager
def back_end_failures() -> Iterator[None]:
    """Gtsam's exceptions, which are RuntimeError, IndexError or ValueError as it happens, as ours."""
    try:
        yield
    except (RuntimeError, IndexError, ValueError) as error:
        raise BackEndError(str(error).strip().splitlines()[0] if str(error).strip() else repr(error)) from error


def all_poses(values: gtsam.Values) -> tuple[Key, NDArray[np.float64]]:
    """The first key and the poses (K, 4, 4) of consecutive keys."""
    rows = gtsam.utilities.extractPose3(values)
    poses = np.zeros((len(rows), 4, 4))
    poses[:, :3, :3] = rows[:, :9].reshape(-1, 3, 3)
    poses[:, :3, 3] = rows[:, 9:]
    poses[:, 3, 3] = 1.0
    return values.keys()[0], poses


def _chosen(estimates: tuple[Key, NDArray[np.float64]], keys: Sequence[Key]) -> NDArray[np.float64]:
    """Some of the poses (K, 4, 4), rotations put back onto SO(3).

    Raises:
        BackEndError: they are not finite, or not there.
    """
    first, poses = estimates
    rows = np.array(keys) - first
    if rows.min() < 0 or rows.max() >= len(poses):
        raise BackEndError("the window has moved on beyond an instant that is asked for")
    chosen = poses[rows]
    if not np.isfinite(chosen).all():
        raise BackEndError("the solution is not finite")
    return orthonormal(chosen)


def _values(poses: Mapping[Key, NDArray[np.float64]]) -> gtsam.Values:
    values = gtsam.Values()
    for key, pose in poses.items():
        values.insert(key, gtsam.Pose3(pose))
    return values


def _stamps(poses: Mapping[Key, NDArray[np.float64]], stamp_s: float) -> dict[Key, float]:
    return dict.fromkeys(poses, stamp_s)
