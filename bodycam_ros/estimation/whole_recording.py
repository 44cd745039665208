"""A recording as a whole: what is unseen follows from what is seen before and after, and the chain is solved again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import SettingsError
from bodycam_ros.estimation.between_factors import SegmentTurn, condition, loosen_joints
from bodycam_ros.estimation.chain import ChainState, Step, smooth
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.equipment_motion import coasting, coasting_trajectory
from bodycam_ros.estimation.estimate import Estimate
from bodycam_ros.estimation.measurements import JointRotations, StateFit
from bodycam_ros.estimation.motion_model import MotionModel
from bodycam_ros.estimation.pose_prior import FORGET_S, PosePrior, RecordedPoses
from bodycam_ros.kinematics.joint import hinge_angle
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.settings import setting

_LEAST_S = 1e-3


class WholeRecording:
    """Solves instants that were solved forwards again, knowing all of them.

    Args:
        body: segments and joints.
        tangent, motion, fit, prior: of the forward pass.
        on_progress: told the share that is done.
    """

    def __init__(
        self,
        body: BodyModel,
        tangent: TreeTangent,
        motion: MotionModel,
        fit: StateFit,
        prior: PosePrior,
        on_progress: Callable[[float], None],
    ) -> None:
        self._body, self._tangent, self._motion, self._fit = body, tangent, motion, fit
        self._prior, self._on_progress = prior, on_progress
        self.reset()

    def reset(self) -> None:
        """After a pause nothing goes on from what was before."""
        self._before: ChainState | None = None
        self._earlier: list[NDArray[Any]] = []

    def solve(self, instants: Sequence[ChainState], count: int, coupling: Coupling | None) -> list[Estimate]:
        """What is known of the first ``count`` instants by all of them."""
        estimates = smooth(instants, self._tangent)
        coasted = self._coast(instants, estimates, coupling) if coupling else {}
        expected = self._predicted(instants, estimates, count)
        again: list[ChainState] = []
        for number, (instant, estimate, better) in enumerate(zip(instants, estimates, expected, strict=True)):
            self._on_progress(number / len(instants))
            before = again[-1] if again else self._before
            step = self._step(instant, before, estimate)
            measured = replace(instant.measured, expected=better + coasted.get(number, JointRotations.nothing()))
            fitted = self._fit.fit(step.after, measured, estimate.at)
            again.append(replace(instant, estimate=fitted, step=step, measured=measured))
        self._before = again[count - 1]
        self._on_progress(1.0)
        return smooth(again, self._tangent)[:count]

    def _coast(
        self, states: Sequence[ChainState], estimates: list[Estimate], coupling: Coupling
    ) -> dict[int, JointRotations]:
        """Rotations of coasting hinges where nothing drove them, by state; the estimates are moved there, in place."""
        coasted: dict[int, JointRotations] = {}
        stamps_s = 1e-9 * np.array([state.stamp_ns - states[0].stamp_ns for state in states])
        for row in coupling.motion.coasting_rows:
            joint = self._body.tree_joints[row]
            driven = np.array([coupling.motion.is_driven(row, state.active) for state in states], bool)
            turned = np.array([estimate.at.motion[row, :3, :3] for estimate in estimates])
            angles = coasting_trajectory(np.unwrap(hinge_angle(turned, joint.axis)), stamps_s, driven)
            rotations = joint.hinge_rotation(angles)
            for place in np.flatnonzero(~driven).tolist():
                motion = estimates[place].at.motion.copy()
                motion[row, :3, :3] = rotations[place]
                estimates[place] = replace(estimates[place], at=replace(estimates[place].at, motion=motion))
                pin = coasting([row], rotations[place][None])
                coasted[place] = coasted.get(place, JointRotations.nothing()) + pin
        return coasted

    def _step(self, instant: ChainState, before: ChainState | None, estimate: Estimate) -> Step:
        """From the instant before, by all that is known of that."""
        if before is None:
            return Step(0.0, self._motion.initial(estimate.at.root, estimate.at.motion))
        step = instant.step
        dt_s = 1e-9 * (instant.stamp_ns - before.stamp_ns)
        link = self._motion.predict(before.estimate, dt_s, step.density, step.fade_s)
        turns = [each for each in step.between if isinstance(each, SegmentTurn)]
        return step.linked(condition(loosen_joints(link, turns, self._tangent), step.between, self._tangent))

    def _predicted(
        self, states: Sequence[ChainState], estimates: Sequence[Estimate], count: int
    ) -> list[JointRotations]:
        """Unobserved joints by these states and those of the blocks before."""
        rotations = np.array([self._body.joint_rotations(estimate.at.poses(self._tangent)) for estimate in estimates])
        stamps_ns = np.array([state.stamp_ns for state in states])
        observed = np.array([state.joints_observed for state in states])
        lasting_s = np.maximum(1e-9 * np.diff(stamps_ns, prepend=stamps_ns[0] - 33_000_000), _LEAST_S)
        by_prior = [
            self._prior.predict(R, state.joints_observed, float(dt_s))
            if state.is_observed
            else JointRotations.nothing()
            for R, state, dt_s in zip(rotations, states, lasting_s, strict=True)
        ]
        known = [stamps_ns, rotations, observed]
        if self._earlier:
            known = [np.concatenate(pair) for pair in zip(self._earlier, known, strict=True)]
        over = len(known[0]) - len(states) + count
        recent = slice(int(np.searchsorted(known[0], known[0][over - 1] - 1e9 * FORGET_S)), over)
        self._earlier = [each[recent] for each in known]
        improved = RecordedPoses(self._prior, *known).improve(by_prior)
        return [
            each.replaced(state.told.which, state.told.rotations, state.told.sigma)
            for each, state in zip(improved, states, strict=True)
        ]


OFFLINE: Final = "offline"
"""The delay of a recording that is solved as a whole."""

_FORWARD_DELAY = 4  # frames after which the forward pass lets an instant go to where the whole recording waits


@dataclass(frozen=True)
class SmootherSettings:
    """Length of the window, and how it is solved."""

    output_delay: int | str = setting(
        4,
        unit="frames",
        limits=(0, 60),
        words=(OFFLINE,),
        reason="a frame is published when this many followed, so that a blink of a camera is bridged from both sides; "
        "'offline' solves the whole recording together, and is for recordings only",
    )
    max_pause: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 10.0),
        reason="a silence of all cameras up to this long is bridged; after a longer one the body begins anew",
    )

    @property
    def whole_recording(self) -> bool:
        """Whether the recording is solved as a whole."""
        return self.output_delay == OFFLINE

    def check_live(self) -> None:
        """Refuse what only a recording can have.

        Raises:
            SettingsError: the whole recording is asked for.
        """
        if self.whole_recording:
            raise SettingsError(
                f"smoother.output_delay is '{OFFLINE}', which solves a recording as a whole once it is over; live, "
                "give the number of frames (0 to 60) that a state waits for later ones"
            )

    @property
    def frames_behind(self) -> int:
        """How many frames follow an instant before the window lets it go."""
        return _FORWARD_DELAY if isinstance(self.output_delay, str) else self.output_delay
