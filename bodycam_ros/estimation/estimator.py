"""The articulated body from the measurements of all cameras (A 4.3): a factor graph that iSAM2 solves over a window.

The states are linked by a motion prior (A eq. 10-11), by measured rotations (A eq. 2) and by points that rest; each has
poses of segments (A eq. 8) and joints of equipment (B eq. 15). A new state is predicted, gated and fitted by itself;
then it enters the window, where iSAM2 solves all of its states together. A delay of 0, 2, 4 frames or the whole
recording is the length of the window.
"""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState, SegmentPose
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.camera_gate import gate_cameras
from bodycam_ros.estimation.contact import ContactSettings, Soles
from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.coupling import CoupledState, Coupling
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.factors.camera_poses import SegmentPoses
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.factors.motion import LASTS_S, MotionModel
from bodycam_ros.estimation.factors.resting_point import RestingPoint
from bodycam_ros.estimation.factors.segment_steps import SegmentStep
from bodycam_ros.estimation.factors.segment_turn import SegmentTurn, measured_turns
from bodycam_ros.estimation.frame_gaps import FrameGaps
from bodycam_ros.estimation.inertial_factors import InertialSensors
from bodycam_ros.estimation.initial_pose import first_poses
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings, MountedCameras
from bodycam_ros.estimation.pose_prior import PosePrior
from bodycam_ros.estimation.published_body import PublishedBody
from bodycam_ros.estimation.solved_state import Measurements, SolvedState, ready_count
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.estimation.state_factors import StateFactors
from bodycam_ros.estimation.state_link import Initial, StateLink
from bodycam_ros.estimation.state_solution import Prediction, fit_state
from bodycam_ros.estimation.static_evidence import StaticCameras, StaticEvidence
from bodycam_ros.estimation.unobserved_time import UnobservedTime
from bodycam_ros.estimation.whole_recording import WholeRecording, first_initial
from bodycam_ros.estimation.window import Window, WindowError
from bodycam_ros.kinematics.tangent import TreeTangent

logger = logging.getLogger(__name__)

Mask = NDArray[np.bool_]

CARRIED_S = 5.0
"""The longest gap that accelerometers fill [s]: their errors grow with the square of time."""

_AGREE_S = 0.5  # how long a recording waits for first frames in which few cameras contradict the others
_FEW = 0.2  # share of the cameras that is few
_KNOWN = 3  # states after which the motion is known
_NO_OPINION = 1e6  # sigma [rad], [m] and of their rates, of a prior on other coordinates
_BENT = 0.2  # of the first guess: from a straight knee, the pose of a foot bends it backwards as well as forwards


class BodyEstimator:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: their names.
        settings, motion, evidence: settings of the estimator and of its steps.
        offline: states may wait until an unobserved limb is observed again.
        coupling: of the body to equipment; ``body`` then includes the equipment.
        contact: whether resting feet are constrained.
        static_cameras: around the body.
        inertial: sensors in the cameras.
        known_rotations: of the joints over the recording, see ``PosePrior``; None to estimate them while solving.
        on_progress: called with the finished share while a recording is solved as a whole.

    Attributes:
        counts: of frames and states so far.

    Raises:
        BodyError: no camera is mounted on the body, and there is no static camera.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Collection[str],
        settings: EstimatorSettings | None = None,
        motion: MotionSettings | None = None,
        evidence: EvidenceSettings | None = None,
        offline: bool = False,
        coupling: Coupling | None = None,
        contact: ContactSettings | None = None,
        static_cameras: StaticCameras | None = None,
        inertial: InertialSensors | None = None,
        known_rotations: Mapping[str, Sequence[Sequence[float]]] | None = None,
        on_progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        self._offline = offline
        self._coupling = coupling
        self._static_cameras = static_cameras
        self._inertial = inertial
        self.body = coupling.body if coupling else body
        self._published = PublishedBody(body, self.body, coupling)
        self.settings = settings or EstimatorSettings()
        self._cameras = {name for name in cameras if name in body.mounts}
        if not self._cameras and static_cameras is None:
            there, carried = ", ".join(cameras) or "there are none", ", ".join(body.mounts)
            raise BodyError(f"body {body.name}: none of the recording's cameras ({there}) is on it; it has {carried}")
        self._soles = Soles(body, contact or ContactSettings())
        self._mounted = MountedCameras(body, evidence or EvidenceSettings())
        self._tangent = TreeTangent(self.body, SLIDES_M)
        self._motion = MotionModel(self._tangent, motion or MotionSettings())
        coupled = coupling.joint_names if coupling else frozenset[str]()
        self._prior = PosePrior(self.body, coupled, known_rotations)
        self._factors = StateFactors(self._tangent, coupled)
        self._gaps = FrameGaps()
        self._whole = WholeRecording(self._motion, self._factors, self._prior, on_progress)
        self._root = body.segment_index[body.root]
        self.counts = SolverCounts()
        self._restart()

    def _restart(self) -> None:
        """Forget the motion: at the start, and after a pause that is too long to be filled."""
        self._states: list[SolvedState] = []
        self._start_ns: int | None = None  # of the first frame with a registered camera
        self._unobserved = UnobservedTime(len(self.body.tree_joints))
        self._window = self._new_window()
        self._static = StaticEvidence(self.body, self._static_cameras, self._published.segments)
        self._whole.reset()
        if self._coupling:
            self._coupling.reset()

    def _new_window(self) -> Window:
        return Window(self._tangent.count, relinearises=not self.settings.whole_recording)

    @property
    def has_states(self) -> bool:
        """Whether there is a state that the next one follows from."""
        return bool(self._states)

    @property
    def period_ns(self) -> float:
        """Period of the frames [ns]; infinite before the second."""
        return self._gaps.period_ns

    def update(self, frame: BodyFrame) -> list[BodyState]:
        """Add one frame, later than the one before.

        Returns:
            The states that are now old enough to publish; empty until a camera is registered, or the body placed.
        """
        if self._coupling:
            self._coupling.start(frame.stamp_ns)
        states = []
        max_pause_s = self._max_pause_s(frame.stamp_ns)
        missing_ns = self._gaps.missing_stamps(frame, max_pause_s)
        if self._states and frame.stamp_ns - self._states[-1].stamp_ns > 1e9 * max_pause_s:
            states = self.flush()
            self._restart()
        registered = self._mounted.absolute_evidence(m for name, m in frame.matches.items() if name in self._cameras)
        if not self._states:
            placed = self._static.place(frame, registered.values())
            if registered or placed:
                self._add(self._first(frame, registered, placed))
        else:
            for stamp_ns in missing_ns:
                self._add(self._next(BodyFrame(stamp_ns, {}), {}))
                self.counts.interpolated += 1
            self._add(self._next(frame, registered))
        return states + self._publish()

    def _add(self, state: SolvedState | None) -> None:
        """Add a state, if there is one."""
        if state is not None:
            self._states.append(state)

    def _max_pause_s(self, stamp_ns: int) -> float:
        """The longest gap before a stamp [ns] that is filled: with inertial sensors on the root, a longer one."""
        longest_s, last_ns = self.settings.max_pause, self._states[-1].stamp_ns if self._states else stamp_ns
        if self._inertial is None or stamp_ns - last_ns <= 1e9 * longest_s:
            return longest_s
        return max(longest_s, CARRIED_S) if self._inertial.carry(last_ns, stamp_ns) else longest_s

    def _first(
        self, frame: BodyFrame, registered: Mapping[str, SegmentPose], placed: list[SegmentPose]
    ) -> SolvedState | None:
        """The first state, where cameras measured the body or it was placed by hand; None where they contradict."""
        poses = first_poses(self.body, [*registered.values(), *placed], _BENT)
        motion = self.body.motion_of(poses, self._tangent.slides)
        at = Coordinates(self._tangent, motion, np.zeros(self._tangent.count))
        link = StateLink.first(first_initial(at, self._motion, self._coupling))
        if not placed and not self._agree(registered, link.prediction, frame.stamp_ns):
            return None
        return self._solve(frame, registered, link, placed)

    def _agree(self, registered: Mapping[str, SegmentPose], prediction: Prediction, stamp_ns: int) -> bool:
        """Whether cameras agree enough where no motion is known yet that shows which of them is wrong.

        Nearly all of them must for half a second, then most.
        """
        accepted, _ = self._gated(registered, prediction)
        self._start_ns = self._start_ns or stamp_ns
        wrong, waited = len(registered) - len(accepted), stamp_ns - self._start_ns > 1e9 * _AGREE_S
        agree = wrong <= len(accepted) if waited else wrong < _FEW * len(registered) or not wrong
        if not agree:
            self.counts.contradictory += 1
            self.counts.rejected.update(registered.keys() - accepted.keys())
        return agree

    def _next(self, frame: BodyFrame, registered: Mapping[str, SegmentPose]) -> SolvedState | None:
        """A state after another: the motion prior (A eq. 10-11), and the rotations measured since (A eq. 2).

        None where cameras contradict each other before the motion is known.
        """
        before, coupling = self._states[-1], self._coupling
        dt_s = 1e-9 * (frame.stamp_ns - before.stamp_ns)
        needs_turn = ~(before.observed & self.body.named(pose.segment for pose in registered.values()))
        steps: list[SegmentStep] = []
        if self._inertial is not None:
            self._inertial.observe(frame)
            steps += self._inertial.factors(before.stamp_ns, frame.stamp_ns, needs_turn)
        needs_turn[[step.segment for step in steps]] = False
        steps += measured_turns(self.body, frame.matches.values(), before.stamps_ns, needs_turn)
        turned = [step.segment for step in steps if isinstance(step, SegmentTurn)]
        prior = None
        if coupling:
            prior = coupling.motion.prior(coupling.attachments.active)
            steps += coupling.standing_points()
        motion = self._motion.between(self._window.at(before.number), dt_s, prior)
        if turned:
            beside = np.isin(self.body.joint_ends, turned).any(axis=1)
            motion = motion.loosened(self._tangent.columns_of(np.asarray(beside)) & self._tangent.turns)
        link = StateLink.after(self._window, before, motion, tuple(steps))
        if link.number < _KNOWN and registered and not self._agree(registered, link.prediction, frame.stamp_ns):
            return None
        return self._solve(frame, registered, link)

    def _restarted(self, link: StateLink, at: Coordinates, columns: Mask) -> StateLink:
        """The same link, but some coordinates (K) are initial, at given ones, and without a past."""
        if not columns.any():
            return link
        both = np.concatenate([columns, columns])
        at = replace(at, velocity=np.where(columns, 0.0, at.velocity))
        known = np.full(len(both), _NO_OPINION) if link.initial is None else link.initial.sigmas
        initial = Initial(at, np.where(both, self._motion.first_sigmas, known))
        if link.before is None or link.motion is None:
            return StateLink.first(initial)
        # What was measured since the state before is of segments as they were then.
        anew = np.asarray(at.jacobians[:, :, columns].any(axis=(1, 2)))
        steps = tuple(step for step in link.steps if not anew[step.segment])
        return StateLink.after(self._window, link.before, link.motion.restarted(columns), steps, initial)

    def _solve(
        self,
        frame: BodyFrame,
        registered: Mapping[str, SegmentPose],
        link: StateLink,
        placed: Sequence[SegmentPose] = (),
    ) -> SolvedState:
        """One state: gate the cameras, collect the other measurements, fit, add contacts, and enter the window."""
        ends = self.body.joint_ends
        dt_s = link.prediction.dt_s
        steps = link.steps
        accepted, start = self._gated(registered, link.prediction)
        self.counts.rejected.update(registered.keys() - accepted.keys())
        known = [*accepted.values(), *placed]
        on_body = self.body.named(pose.segment for pose in accepted.values())
        # Limbs where static cameras found them (B 2). One that was found elsewhere did not move there.
        static = self._static.measure(frame, start.poses, dt_s, known, on_body)
        if static.segments.any():
            motion, at = self.body.motion_of(static.poses(start.poses), self._tangent.slides), link.prediction.at
            joints = static.jumped[ends].any(axis=1)
            columns, restarted = self._tangent.columns_of(joints), np.append(static.jumped[self._root], joints)
            columns[:6] = static.jumped[self._root]
            at = replace(at, motion=np.where(restarted[:, None, None], motion, at.motion))
            link, start = self._restarted(link, at, columns), replace(start, motion=motion)
        observed, turning = static.observed, static.observed
        turning[[step.segment for step in link.steps if isinstance(step, SegmentTurn)]] = True
        joints_observed, joints_turning = on_body[ends].all(axis=1), turning[ends].all(axis=1) | (dt_s == 0.0)
        # The measurements of this state.
        cameras = SegmentPoses.from_evidence(self.body, [*known, *static.evidence])
        predicted = self._prior.predict(joints_observed, joints_turning, dt_s or LASTS_S)
        expected, keypoints = predicted.replaced(static.joints()), static.measured.keypoints
        measured, coupled = Measurements(cameras, expected, keypoints=keypoints), None
        if self._coupling:
            coupled = self._coupling.update(frame.stamp_ns, start, on_body | static.segments)
            measured, link = self._couple(self._coupling, coupled, measured, link)
            start = coupled.start
        # The state that fits them best (A eq. 8, B eq. 15).
        fit = fit_state(link.prediction, self._factors.stages(measured), [start])
        self.counts.unconverged += not fit.converged
        self._prior.add(fit.at.joints[:, :3, :3], joints_observed, dt_s)
        self._unobserved.add(observed, joints_observed, dt_s)
        # Points of the soles that rest.
        resting = self._soles.resting(link.prediction.before.poses, fit.at.poses, dt_s, turning)
        if link.before is None:
            resting = []
        state = SolvedState(
            number=link.number,
            stamp_ns=frame.stamp_ns,
            stamps_ns={camera: matches.stamp_ns for camera, matches in frame.matches.items()},
            chart=Chart(fit.at),
            dt_s=dt_s,
            motion=link.motion,
            steps=(*steps, *resting),  # a second pass knows better where a segment was that began anew
            measured=measured,
            joints_observed=joints_observed,
            turning=joints_turning,
            static=static,
            observed=observed,
            cameras_used=len(accepted) + static.camera_count,
            converged=fit.converged,
            active=coupled.active if coupled else None,
            square_root=link.prediction.square_root,
        )
        self._enter_window(state, link, resting)
        return state

    def _enter_window(self, state: SolvedState, link: StateLink, resting: list[RestingPoint]) -> None:
        """Solve the window with a new state; if gtsam cannot, a new window from the state's prediction."""
        measured = self._factors.of(state.measured)
        oldest = min([*(each.number for each in self._states if not each.is_published), state.number])
        try:
            state.square_root = link.enter(self._window, state.chart, resting, measured, oldest)
        except WindowError as error:
            self._note_failure(state.stamp_ns, error)
            self._window = self._new_window()
            state.square_root = link.restart(self._window, state.chart, measured)
        if self._coupling and self._coupling.has_lengths:
            self._coupling.remember_lengths(self._window.at(state.number), state.covariance)

    def _note_failure(self, stamp_ns: int, error: WindowError) -> None:
        logger.warning("the solver's window was restarted at %.3f s: %s", 1e-9 * stamp_ns, error)
        self.counts.restarted += 1

    def _gated(
        self, registered: Mapping[str, SegmentPose], prediction: Prediction
    ) -> tuple[dict[str, SegmentPose], Coordinates]:
        """The cameras that pass the chi-square gate, and the coordinates that fit them."""
        poses = SegmentPoses.from_evidence(self.body, registered.values())
        unobserved = self._unobserved.columns(self._tangent) if self._states else np.ones(self._tangent.count, bool)
        accepted, at = gate_cameras(prediction, poses, unobserved)
        return {name: pose for (name, pose), passes in zip(registered.items(), accepted, strict=True) if passes}, at

    def _couple(
        self, coupling: Coupling, coupled: CoupledState, measured: Measurements, link: StateLink
    ) -> tuple[Measurements, StateLink]:
        """Measurements and prediction with the equipment."""
        before = self._states[-1].active if self._states else None
        at, columns = coupling.restarted(link.prediction.at, coupled, before)
        cameras = measured.cameras + coupling.upright_measurement(coupled)
        expected = measured.expected + coupled.expected(at)
        measured = Measurements(cameras, expected, coupled.closed, measured.keypoints)
        return measured, self._restarted(link, at, columns)

    def flush(self) -> list[BodyState]:
        """The states that still wait for later frames; the recording is over."""
        return self._publish_until(len(self._states))

    def _publish(self) -> list[BodyState]:
        """States that need not wait any more."""
        if not self._states:
            return []
        latest = self._states[-1]
        for state in self._states[:-1]:
            state.follow(latest)
        return self._publish_until(ready_count(self._states, self.settings, self._offline))

    def _publish_until(self, count: int) -> list[BodyState]:
        """The first ``count`` states; the latest of all stays in the chain, for the next one follows from it."""
        pending = [state for state in self._states[:count] if not state.is_published]
        if not pending:
            return []
        waiting = pending
        if self.settings.whole_recording:
            waiting = [state for state in self._states if not state.is_published]
        solutions = [(self._smoothed(state), state.covariance) for state in waiting]
        if self.settings.whole_recording:
            try:
                solutions = self._whole.solve(waiting, len(pending), [at for at, _ in solutions], self._coupling)
            except WindowError as error:
                self._note_failure(pending[0].stamp_ns, error)  # its states are those of the forward pass
        for state in pending:
            state.is_published = True
        self._states = [state for state in self._states[:-1] if not state.is_published] + self._states[-1:]
        return [self._published.state(state, *each) for state, each in zip(pending, solutions, strict=False)]

    def _smoothed(self, state: SolvedState) -> Coordinates:
        """Coordinates of a state by the window, or as they were when a window failed."""
        return self._window.at(state.number) if state.number in self._window else state.chart.origin
