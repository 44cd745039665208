"""A whole recording: unobserved joints follow from what is observed before and after; the chain is solved again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import SettingsError
from bodycam_ros.estimation.between_factors import condition
from bodycam_ros.estimation.chain import ChainState, smooth
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.equipment_motion import coasting, coasting_trajectory
from bodycam_ros.estimation.estimate import Coordinates, Transition
from bodycam_ros.estimation.measurements import JointRotations, StateFit
from bodycam_ros.estimation.motion_model import LASTS_S, MotionModel
from bodycam_ros.estimation.pose_prior import FORGET_S, PosePrior, RecordedPoses
from bodycam_ros.kinematics.joint import hinge_angle
from bodycam_ros.settings import setting


class WholeRecording:
    """Solves states of the forward pass again, given all of them.

    Args:
        body: segments and joints.
        motion, fit, prior: of the forward pass.
        on_progress: called with the finished share.
    """

    def __init__(
        self,
        body: BodyModel,
        motion: MotionModel,
        fit: StateFit,
        prior: PosePrior,
        on_progress: Callable[[float], None],
    ) -> None:
        self._body, self._motion, self._fit = body, motion, fit
        self._prior, self._on_progress = prior, on_progress
        self.reset()

    def reset(self) -> None:
        """Forget the states before a pause."""
        self._before: ChainState | None = None
        self._earlier: list[NDArray[Any]] = []

    def solve(self, states: Sequence[ChainState], count: int, coupling: Coupling | None) -> list[Coordinates]:
        """Coordinates of the first ``count`` states given all."""
        smoothed = smooth(states)
        coasted = self._coast(states, smoothed, coupling) if coupling else {}
        predicted = self._predicted(states, smoothed, count)
        again: list[ChainState] = []
        for number, (state, at, better) in enumerate(zip(states, smoothed, predicted, strict=True)):
            self._on_progress(number / len(states))
            before, link = again[-1] if again else self._before, state.link
            if before is None:
                initial = self._motion.initial(at.motion)
                link = Transition.first(coupling.initial(initial) if coupling else initial)
            else:
                dt_s = 1e-9 * (state.stamp_ns - before.stamp_ns)
                link = condition(self._motion.predict(before.estimate, dt_s, link.prior), link.between)
            measured = replace(state.measured, expected=better + coasted.get(number, JointRotations.nothing()))
            again.append(replace(state, link=self._fit.fit(link, measured, at), measured=measured))
        self._before = again[count - 1]
        self._on_progress(1.0)
        return smooth(again)[:count]

    def _coast(
        self, states: Sequence[ChainState], smoothed: list[Coordinates], coupling: Coupling
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
        self, states: Sequence[ChainState], smoothed: Sequence[Coordinates], count: int
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
        return [each.replaced(state.by_static) for each, state in zip(improved, states, strict=True)]


OFFLINE: Final = "offline"
"""The delay of a recording that is solved as a whole."""


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
        reason="a gap without images up to this long is filled; after a longer one the body is initialised again",
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
