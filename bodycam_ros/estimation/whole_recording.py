"""A recording as a whole: what is unseen follows from what is seen before and after, and the chain is solved again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import SettingsError
from bodycam_ros.estimation.belief import Belief
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.equipment_motion import coasting
from bodycam_ros.estimation.equipment_motion import on_the_way as on_the_way_of
from bodycam_ros.estimation.instant import Instant, Step, smoothed
from bodycam_ros.estimation.measurements import InstantFit, JointRotations
from bodycam_ros.estimation.motion_model import MotionModel, SegmentTurn, freed, given
from bodycam_ros.estimation.pose_prior import PosePrior, RecordedPoses
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
        fit: InstantFit,
        prior: PosePrior,
        on_progress: Callable[[float], None],
    ) -> None:
        self._body, self._tangent, self._motion, self._fit = body, tangent, motion, fit
        self._prior, self._on_progress = prior, on_progress
        self.begin_anew()

    def begin_anew(self) -> None:
        """After a pause nothing goes on from what was before."""
        self._before: Instant | None = None
        self._recorded = RecordedPoses(self._prior)

    def solve(self, instants: Sequence[Instant], count: int, coupling: Coupling | None) -> list[Belief]:
        """What is known of the first ``count`` instants by all of them."""
        beliefs = smoothed(instants, self._tangent)
        turned_on = self._turned_on(instants, beliefs, coupling) if coupling else {}
        expected = self._expected(instants, beliefs)
        self._recorded.keep(count)
        again: list[Instant] = []
        for number, (instant, belief, better) in enumerate(zip(instants, beliefs, expected, strict=True)):
            self._on_progress(number / len(instants))
            before = again[-1] if again else self._before
            step = self._step(instant, before, belief)
            measured = replace(instant.measured, expected=better + turned_on.get(number, JointRotations.nothing()))
            fitted = self._fit.fit(step.after, measured, belief.at)
            again.append(replace(instant, belief=fitted, step=step, measured=measured))
        self._before = again[count - 1]
        self._on_progress(1.0)
        return smoothed(again, self._tangent)[:count]

    def _turned_on(
        self, instants: Sequence[Instant], beliefs: list[Belief], coupling: Coupling
    ) -> dict[int, JointRotations]:
        """Where hinges must have turned on by themselves; the beliefs are moved there, in place."""
        on_the_way: dict[int, JointRotations] = {}
        stamps_s = 1e-9 * np.array([instant.stamp_ns - instants[0].stamp_ns for instant in instants])
        for row in coupling.keeping():
            joint = self._body.tree_joints[row]
            driven = np.array([coupling.drives(joint, instant.holding) for instant in instants], bool)
            turned = np.array([belief.at.motion[row, :3, :3] for belief in beliefs])
            angles = on_the_way_of(np.unwrap(hinge_angle(turned, joint.axis)), stamps_s, driven)
            rotations = joint.hinge_rotation(angles)
            for place in np.flatnonzero(~driven).tolist():
                motion = beliefs[place].at.motion.copy()
                motion[row, :3, :3] = rotations[place]
                beliefs[place] = replace(beliefs[place], at=replace(beliefs[place].at, motion=motion))
                pin = coasting([row], rotations[place][None])
                on_the_way[place] = on_the_way.get(place, JointRotations.nothing()) + pin
        return on_the_way

    def _step(self, instant: Instant, before: Instant | None, belief: Belief) -> Step:
        """From the instant before, by all that is known of that."""
        if before is None:
            return Step(0.0, self._motion.begin(belief.at.root, belief.at.motion))
        step = instant.step
        dt_s = 1e-9 * (instant.stamp_ns - before.stamp_ns)
        link = self._motion.predict(before.belief, dt_s, step.density, step.fade_s)
        turns = [each for each in step.between if isinstance(each, SegmentTurn)]
        return step.linked(given(freed(link, turns, self._tangent), step.between, self._tangent))

    def _expected(self, instants: Sequence[Instant], beliefs: Sequence[Belief]) -> list[JointRotations]:
        """Where unseen joints are expected, by all that is known of the recording by now."""
        rotations = np.array([self._body.joint_rotations(belief.at.poses(self._tangent)) for belief in beliefs])
        stamps_ns = np.array([instant.stamp_ns for instant in instants])
        lasting_s = np.maximum(1e-9 * np.diff(stamps_ns, prepend=stamps_ns[0] - 33_000_000), _LEAST_S)
        by_prior = [
            self._prior.expect(R, instant.joints_seen, instant.turning, float(dt_s))
            if instant.is_observed
            else JointRotations.nothing()
            for R, instant, dt_s in zip(rotations, instants, lasting_s, strict=True)
        ]
        seen = np.array([instant.joints_seen for instant in instants])
        better = self._recorded.expect(stamps_ns, rotations, seen, by_prior)
        return [
            each.replaced(instant.told.which, instant.told.rotations, instant.told.sigma)
            for each, instant in zip(better, instants, strict=True)
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
    block: float = setting(
        15.0,
        unit="s",
        limits=(1.0, 600.0),
        reason="offline, so much of a recording is solved together: memory for an hour of it at once is nobody's",
    )
    overlap: float = setting(
        1.5,
        unit="s",
        limits=(0.1, 60.0),
        reason="offline, so much of what follows a block is solved with it, and again with the next; what comes later "
        "changes nothing",
    )
    max_pause: float = setting(
        1.0,
        unit="s",
        limits=(0.05, 10.0),
        reason="a silence of all cameras up to this long is bridged; after a longer one the body begins anew",
    )
    blind_hold: float = setting(
        10.0,
        unit="s",
        limits=(0.0, 60.0),
        reason="offline, what is published waits this long at most for a blind limb to be seen again, so that its "
        "rotation can be averaged from both sides; 0 never waits, as live",
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
