"""How an instant follows from those before: where segments go by themselves, and its factors (A eq. 10-11)."""

from collections.abc import Collection

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse
from bodycam_ros.kinematics.limits import JointLimits
from bodycam_ros.solving.body_factors import BodyFactors
from bodycam_ros.solving.body_window import BodyWindow
from bodycam_ros.solving.camera_evidence import SegmentPose
from bodycam_ros.solving.coupling import Coupling
from bodycam_ros.solving.motion import MotionSettings, motion_sigmas, predict
from bodycam_ros.solving.start_poses import first_poses, hung

Array = NDArray[np.float64]

_BEGIN = np.full(6, 0.5)
"""Sigmas [rad], [m] of where a body begins: next to a camera nothing, yet not too vague for a Cholesky factor."""


class GoingOn:
    """The motion of a body, and of what it is coupled to, from instant to instant.

    Args:
        body: segments and joints.
        window: of the instants before.
        factors: makes the factors.
        settings: how suddenly a segment may change its motion.
        coupling: the equipment, which moves in ways of its own.
    """

    def __init__(
        self,
        body: BodyModel,
        window: BodyWindow,
        factors: BodyFactors,
        settings: MotionSettings,
        coupling: Coupling | None,
    ) -> None:
        self._body, self._window, self._factors = body, window, factors
        self._settings, self._coupling = settings, coupling
        self._bent = JointLimits(body).middle()

    def begin(self, evidence: Collection[SegmentPose]) -> Array:
        """Poses (S, 4, 4) of a body that begins, its equipment beside it.

        Coupled to something, limbs that are not seen begin bent: a straight leg that a pedal shortens might fold the
        wrong way.
        """
        poses = first_poses(self._body, evidence)
        if self._coupling:
            known = np.zeros(len(poses), bool)
            known[[self._body.segment_index[seen.segment] for seen in evidence]] = True
            known[self._coupling.rows] = True
            poses = hung(self._body, poses, self._bent, known)
            self._coupling.predict(poses, None, 0.0)
        return poses

    def predict(self, stamp_ns: int, dt_s: float, jumped: Collection[int]) -> Array | None:
        """Poses (S, 4, 4) at the velocity of the latest two instants; None while there is none.

        Args:
            stamp_ns: to predict for.
            dt_s: since the latest instant [s].
            jumped: rows of segments that were put elsewhere at that instant: the step before is no velocity.
        """
        if not self._window.instants:
            return None
        latest = self._window.instants[-1]
        world_T_segment = self._window.poses(latest)
        if len(self._window.instants) == 1:
            predicted = world_T_segment.copy()
        else:
            before = self._window.instants[-2]
            before_s, ahead_s = 1e-9 * (latest.stamp_ns - before.stamp_ns), 1e-9 * (stamp_ns - latest.stamp_ns)
            predicted = predict(self._window.poses(before), world_T_segment, before_s, ahead_s, self._settings)
            rows = list(jumped)
            predicted[rows] = world_T_segment[rows]
        if self._coupling:
            self._coupling.predict(predicted, world_T_segment, dt_s)
        return predicted

    def past(self, index: int, dt_s: float, path: Array, start: Array) -> gtsam.NonlinearFactorGraph:
        """How the instant hangs on the one before, or what stands in for it at the start.

        Args:
            index: of the instant.
            dt_s: since the one before [s].
            path: (S, 4, 4) where segments go by themselves.
            start: (S, 4, 4) where they start.
        """
        everything = range(len(path))
        if index == 0:
            return self._factors.anchor(index, dict(enumerate(start if self._coupling else path)), _BEGIN)
        instants = self._window.instants
        previous_dt_s = 1e-9 * (instants[-1].stamp_ns - instants[-2].stamp_ns) if len(instants) > 1 else dt_s
        steps = inverse(self._window.poses(instants[-1])) @ path
        sigmas = np.tile(motion_sigmas(dt_s, previous_dt_s, self._settings), (len(path), 1))
        if not self._coupling:
            return self._factors.motion(index, steps, sigmas, everything)
        sigmas[self._coupling.rows] = self._coupling.sigmas(dt_s, previous_dt_s)
        begins = {} if self._coupling.went_on else {row: start[row] for row in self._coupling.rows.tolist()}
        graph = self._factors.anchor(index, begins, _BEGIN)
        standing = self._coupling.standing
        if standing:
            graph.push_back(self._factors.anchor(index, {standing.row: standing.pose}, standing.sigmas))
        still = {*begins, standing.row} if standing else begins
        graph.push_back(self._factors.motion(index, steps, sigmas, [row for row in everything if row not in still]))
        return graph

    def learn_speeds(self, dt_s: float) -> None:
        """After the latest instant was solved, the equipment hears how it moved in the time before it [s]."""
        if self._coupling and len(self._window.instants) > 1:
            before, latest = list(self._window.instants)[-2:]
            self._coupling.learn_speeds(self._window.poses(latest), self._window.poses(before), dt_s)
