"""All factors of one state, by its measurements."""

from collections.abc import Collection, Mapping

import numpy as np

from bodycam_ros.estimation.factors.factor import StateFactor
from bodycam_ros.estimation.factors.joint_rotations import ExpectedJoints, SoftSlides
from bodycam_ros.estimation.factors.loops import Loops
from bodycam_ros.estimation.solved_state import Measurements
from bodycam_ros.kinematics.tangent import TreeTangent


class StateFactors:
    """Makes the factors of states.

    Args:
        tangent: the body's coordinates.
        attachments: names of loops that are closed at times; the others always are.
    """

    def __init__(self, tangent: TreeTangent, attachments: Collection[str] = ()) -> None:
        self._tangent, self._slides = tangent, SoftSlides(tangent)
        self._loops = Loops(tangent.tree, attachments)

    def stages(self, measured: Measurements) -> list[list[StateFactor]]:
        """Factors to fit a state by, one list after the other.

        In a first one nothing that is far apart counts less: what was placed anew is far from what holds it.
        """
        first = [self.of(measured, dict.fromkeys(measured.closed, np.inf))] if measured.closed else []
        return [*first, self.of(measured)]

    def of(self, measured: Measurements, closed: Mapping[str, float] | None = None) -> list[StateFactor]:
        """Factors with a row at least: cameras, keypoints, expected joints, slides, loops that are closed.

        Args:
            measured: of the state.
            closed: attachments that close loops -> sigmas from which on each counts less, if not as measured.
        """
        expected = ExpectedJoints(self._tangent, measured.expected)
        loops = self._loops.closed(measured.closed if closed is None else closed)
        factors: list[StateFactor] = [measured.cameras, measured.keypoints, expected, self._slides, loops]
        return [factor for factor in factors if factor.rows]
