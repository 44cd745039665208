"""The instants that are still being solved, and what to do when the solver cannot.

A factor graph whose information spans too many orders of magnitude is indeterminate to gtsam, however well-posed it
is. Then the window begins anew from where the body was: one instant is less certain, none is lost.
"""

import logging
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.solving.back_end import BackEnd, BackEndError, BatchBackEnd, IncrementalBackEnd
from bodycam_ros.solving.body_covariance import BodyUncertainty
from bodycam_ros.solving.body_factors import BodyFactors, merged
from bodycam_ros.solving.body_now import BodyNow
from bodycam_ros.solving.recorded_instants import Recorded
from bodycam_ros.solving.smoother_settings import SmootherSettings

logger = logging.getLogger(__name__)

_RESTART = np.repeat([0.1, 0.05], 3)
"""Sigmas [rad], [m] of where the body was when its window was lost."""

_OF_THE_PAST = ("past", "turns", "contacts")
"""Factors of an instant that tie it to earlier ones."""


@dataclass
class Instant:
    """An instant of the window.

    Attributes:
        index: number; its variables are named by it.
        stamp_ns: when.
        camera_stamps_ns: camera -> its own stamp [ns].
        world_T_segment: (S, 4, 4) estimate, which later instants improve.
        observed: (S,) whether a camera on the segment spoke and was believed.
        cameras_used: how many did.
        uncertainty: covariances.
        recorded: what it brought.
        solution: the number of the solution that the estimate is from; -1 of a start value.
    """

    index: int
    stamp_ns: int
    camera_stamps_ns: Mapping[str, int]
    world_T_segment: NDArray[np.float64]
    observed: NDArray[np.bool_]
    cameras_used: int
    uncertainty: BodyUncertainty
    recorded: Recorded
    solution: int = -1


class BodyWindow:
    """The latest instants, oldest first, and the back end that solves them.

    Args:
        factors: names the variables, makes the anchor of a new beginning.
        settings: length and kind of the window.

    Attributes:
        instants: those that may still change or be asked for.
        restarts: how often the back end failed and the window began anew.
    """

    def __init__(self, factors: BodyFactors, settings: SmootherSettings) -> None:
        self._factors = factors
        self._settings = settings
        kept = max(3, settings.frames_behind + 2)
        self.instants: deque[Instant] = deque(maxlen=kept)
        self._longest_step_s = settings.window / kept
        self.restarts = 0
        self._solution = 0
        self._begin()

    def _begin(self) -> None:
        settings = self._settings
        self._back_end: BackEnd = (
            IncrementalBackEnd(settings.window, settings.extra_updates, settings.relinearize_threshold)
            if settings.incremental
            else BatchBackEnd(settings.window)
        )
        self._clock_s = 0.0
        self._solved_from = self.instants[-1].index + 1 if self.instants else 0

    def clear(self) -> None:
        """Forget everything."""
        self.instants.clear()
        self._begin()

    def add(self, instant: Instant, factors: Mapping[str, gtsam.NonlinearFactorGraph]) -> None:
        """Solve with a new instant, whose poses are start values.

        Args:
            instant: its index follows that of the latest.
            factors: all that is known of it; "past" ties it to the instant before.
        """
        keys = self._factors.keys(instant.index)
        start = dict(zip(keys, instant.world_T_segment, strict=True))
        # Time of the window: low rates and pauses must not push out what is still to be published.
        if self.instants:
            passed_s = 1e-9 * (instant.stamp_ns - self.instants[-1].stamp_ns)
            self._clock_s += min(passed_s, self._longest_step_s)
        self.instants.append(instant)
        if self.reaches(instant.index - 1) or instant.index == 0:
            try:
                self._back_end.update(merged(factors), start, self._clock_s)
                self._read(instant)
                return
            except BackEndError as error:
                self._fail(error)
        # Without what ties it to a past that is lost.
        anchor = self._factors.anchor(instant.index, dict(enumerate(instant.world_T_segment)), _RESTART)
        alone = {name: graph for name, graph in factors.items() if name not in _OF_THE_PAST} | {"past": anchor}
        for graphs in (alone, {"past": anchor}):
            self._begin()
            self._solved_from = instant.index
            try:
                self._back_end.update(merged(graphs), start, self._clock_s)
                self._read(instant)
                return
            except BackEndError as error:
                self._fail(error)
        self._solved_from = instant.index + 1

    @property
    def lately(self) -> list[BodyNow]:
        """The body at the latest two instants, as far as there are, oldest first, as they are known by now."""
        return [
            BodyNow(instant.stamp_ns, self.poses(instant), instant.uncertainty.segments, instant.observed)
            for instant in list(self.instants)[-2:]
        ]

    def reaches(self, index: int) -> bool:
        """Whether an instant's variables are in the back end, so that factors may speak of them."""
        return bool(self.instants) and self._solved_from <= index and index >= self.instants[0].index

    def settle(self) -> None:
        """Iterate until nothing moves; for the last instants, which no later one will improve."""
        try:
            self._back_end.settle()
            self._read(self.instants[-1])
        except BackEndError as error:
            self._fail(error)

    def poses(self, instant: Instant) -> NDArray[np.float64]:
        """The latest estimate (S, 4, 4) of an instant."""
        if instant.index >= self._solved_from and instant.solution != self._solution:
            try:
                self._read_poses(instant)
            except BackEndError as error:
                self._fail(error)
        return instant.world_T_segment

    def _read(self, newest: Instant) -> None:
        """There is a new solution, if its newest poses make sense."""
        self._solution += 1
        self._read_poses(newest)

    def _read_poses(self, instant: Instant) -> None:
        instant.world_T_segment = self._back_end.poses(self._factors.keys(instant.index))
        instant.solution = self._solution

    def _fail(self, error: BackEndError) -> None:
        self.restarts += 1
        if self.restarts == 1:
            logger.warning("the solver began anew at %d ns: %s", self.instants[-1].stamp_ns, error)
