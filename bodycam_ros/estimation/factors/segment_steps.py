"""Measurements of single segments in two states, stacked: the errors of each by poses and twists of its segment."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.geometry import Array


class SegmentStep(Protocol):
    """A measurement of one segment in two states, in M rows."""

    @property
    def segment(self) -> int:
        """Row of the segment."""

    def residual(self, before: Array, after: Array, *twists: Array) -> tuple[Array, Array, Array]:
        """Errors (M) in sigmas, of the earlier and the later pose (4, 4) and twist (6).

        With them come the Jacobians (M, 12) by tangents of the earlier pose and by its twist, and by the later ones.
        """


class SegmentSteps:
    """All measurements between two states.

    Args:
        steps: one at least.
    """

    def __init__(self, steps: Sequence[SegmentStep]) -> None:
        self._steps = tuple(steps)
        self._segments = [step.segment for step in steps]
        identity = np.eye(4)
        self.rows = sum(len(step.residual(identity, identity, *np.zeros((2, 6)))[0]) for step in self._steps)

    def linearise(self, before: Coordinates, after: Coordinates) -> tuple[Array, Array, Array]:
        """See ``StepFactor``."""
        K, end = before.tangent.count, 0
        errors, by_before, by_after = np.empty(self.rows), *np.zeros((2, self.rows, 2 * K))
        J = before.jacobians[self._segments], after.jacobians[self._segments]
        for number, step in enumerate(self._steps):
            tangents = J[0][number], J[1][number]
            twists = tangents[0] @ before.velocity, tangents[1] @ after.velocity
            poses = before.poses[step.segment], after.poses[step.segment]
            r, *by_segment = step.residual(*poses, *twists)
            part = slice(end, end := end + len(r))
            errors[part] = r
            for whole, by, tangent in zip((by_before, by_after), by_segment, tangents, strict=True):
                whole[part, :K], whole[part, K:] = by[:, 6:] @ tangent, by[:, :6] @ tangent
        return errors, by_before, by_after
