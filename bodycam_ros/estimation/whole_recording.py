"""A whole recording: unobserved joints follow from what is observed before and after; the graph is solved again."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.equipment_motion import coasting, coasting_trajectory
from bodycam_ros.estimation.factors.factor import state_key
from bodycam_ros.estimation.factors.joint_rotations import JointRotations
from bodycam_ros.estimation.factors.motion import LASTS_S, MotionModel
from bodycam_ros.estimation.pose_prior import FORGET_S, PosePrior, RecordedPoses
from bodycam_ros.estimation.solved_state import SolvedState
from bodycam_ros.estimation.state_factors import StateFactors
from bodycam_ros.estimation.state_link import Initial, StateLink
from bodycam_ros.estimation.state_solution import Prediction, fit_state
from bodycam_ros.estimation.window import Window
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import hinge_angle

Solution = tuple[Coordinates, Array]


def first_initial(at: Coordinates, motion: MotionModel, coupling: Coupling | None) -> Initial:
    """What is known of a first state at some coordinates: that it is a person's, and lengths of equipment."""
    if coupling is None:
        return Initial(at, motion.first_sigmas)
    return Initial(*coupling.initial(at, motion.first_sigmas))


class WholeRecording:
    """Solves the states of the forward pass again, given all of them.

    Args:
        motion, factors, prior: of the forward pass.
        on_progress: called with the finished share.
    """

    def __init__(
        self, motion: MotionModel, factors: StateFactors, prior: PosePrior, on_progress: Callable[[float], None]
    ) -> None:
        self._body = motion.tangent.tree
        self._motion = motion
        self._factors = factors
        self._prior, self._on_progress = prior, on_progress
        self.reset()

    def reset(self) -> None:
        """Forget the states before a pause."""
        self._before: SolvedState | None = None
        self._earlier: list[NDArray[Any]] = []

    def solve(
        self, states: Sequence[SolvedState], count: int, smoothed: list[Coordinates], coupling: Coupling | None
    ) -> list[Solution]:
        """Coordinates and covariances (2K, 2K) of the first ``count`` states given all.

        Args:
            states: of the forward pass.
            count: of those that are followed by enough others, or by none of the recording.
            smoothed: coordinates of all by the forward pass.
            coupling: to equipment, if any.

        Raises:
            WindowError: gtsam cannot solve them; those after them can be solved.
        """
        coasted = self._coast(states, smoothed, coupling) if coupling else {}
        predicted = self._predicted(states, smoothed, count)
        window, again = Window(self._motion.tangent.count, relinearises=False), list[SolvedState]()
        before, self._before = self._before, None
        if before is not None:
            # All that precedes it is in its information.
            prior = Prediction(before.chart.origin, before.chart.origin, before.square_root, 0.0)
            known = gtsam.NonlinearFactorGraph()
            known.add(prior.factor(state_key(before.number), before.chart))
            window.add(before.number, before.chart, known, 0)
        for number, (state, at, better) in enumerate(zip(states, smoothed, predicted, strict=True)):
            self._on_progress(number / len(states))
            measured = replace(state.measured, expected=better + coasted.get(number, JointRotations.nothing()))
            before = self._solve_again(window, before, replace(state, measured=measured), at, coupling)
            again.append(before)
            if number == count - 1:
                self._before = replace(before, chart=Chart(window.at(before.number)))
        window.relinearise()
        self._on_progress(1.0)
        return [(window.at(state.number), state.covariance) for state in again[:count]]

    def _solve_again(
        self, window: Window, before: SolvedState | None, state: SolvedState, at: Coordinates, coupling: Coupling | None
    ) -> SolvedState:
        """A state with its other measurements, from coordinates given all of the forward pass."""
        if before is None or state.motion is None:
            link = StateLink.first(first_initial(at, self._motion, coupling))
        else:
            # A limb that was lost and found again did not begin anew.
            motion = replace(state.motion, kept=np.ones_like(state.motion.kept))
            link = StateLink.after(window, before, motion, state.steps)
        fit = fit_state(link.prediction, self._factors.stages(state.measured), [at, link.prediction.at])
        chart, measured = Chart(fit.at), self._factors.of(state.measured)
        root = link.enter(window, chart, (), measured, 0)
        return replace(state, number=link.number, chart=chart, square_root=root)

    def _coast(
        self, states: Sequence[SolvedState], smoothed: list[Coordinates], coupling: Coupling
    ) -> dict[int, JointRotations]:
        """Rotations of coasting hinges where nothing drove them, by state; moves the coordinates there."""
        coasted: dict[int, JointRotations] = {}
        stamps_s = 1e-9 * np.array([state.stamp_ns - states[0].stamp_ns for state in states])
        for row in coupling.motion.coasting_rows:
            joint = self._body.tree_joints[row]
            driven = np.array([coupling.motion.is_driven(row, state.active) for state in states], bool)
            turned = np.array([at.joints[row, :3, :3] for at in smoothed])
            angles = coasting_trajectory(np.unwrap(hinge_angle(turned, joint.axis)), stamps_s, driven)
            rotations = joint.hinge_rotation(angles)
            for place in np.flatnonzero(~driven).tolist():
                joints = smoothed[place].joints.copy()
                joints[row, :3, :3] = rotations[place]
                smoothed[place] = smoothed[place].placed(joints)
                pin = coasting([row], rotations[place][None])
                coasted[place] = coasted.get(place, JointRotations.nothing()) + pin
        return coasted

    def _predicted(
        self, states: Sequence[SolvedState], smoothed: Sequence[Coordinates], count: int
    ) -> list[JointRotations]:
        """Unobserved joints by these states and those of the blocks before."""
        rotations = np.array([at.joints[:, :3, :3] for at in smoothed])
        stamps_ns = np.array([state.stamp_ns for state in states])
        observed = np.array([state.joints_observed for state in states])
        lasting_s = np.append(LASTS_S, 1e-9 * np.diff(stamps_ns))
        by_prior = [
            self._prior.predict(state.joints_observed, state.turning, float(dt_s))
            if state.is_observed
            else JointRotations.nothing()
            for state, dt_s in zip(states, lasting_s, strict=True)
        ]
        known = [stamps_ns, rotations, observed]
        if self._earlier:
            known = [np.concatenate(pair) for pair in zip(self._earlier, known, strict=True)]
        over = len(known[0]) - len(states) + count
        recent = slice(int(np.searchsorted(known[0], known[0][over - 1] - 1e9 * FORGET_S)), over)
        self._earlier = [each[recent] for each in known]
        improved = RecordedPoses(self._prior, *known).improve(by_prior)
        return [each.replaced(state.static.joints()) for each, state in zip(improved, states, strict=True)]
