"""The articulated body from the measurements of all cameras (A 4.3): forwards state by state, then backwards.

The states are a chain, and the chain is a factor graph: a motion prior between neighbours (A eq. 10-11), measured
rotations between them (A eq. 2), poses of segments (A eq. 8) and joints of equipment (B eq. 15) at each. Going forwards
each state is predicted, gated and fitted; going backwards each is smoothed by the later ones. A delay of 0, 2, 4 frames
or the whole recording differ in how far back that goes.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyState, SegmentPose
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.between_factors import SegmentTurn, condition, measured_turns
from bodycam_ros.estimation.camera_gate import gate_cameras
from bodycam_ros.estimation.chain import ChainState, first_poses, smooth
from bodycam_ros.estimation.contact import ContactSettings, Soles
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.estimate import Between, Coordinates, Transition, body_uncertainty
from bodycam_ros.estimation.frame_gaps import FrameGaps
from bodycam_ros.estimation.inertial_factors import InertialSensors
from bodycam_ros.estimation.measurements import (
    SLIDES_M,
    EvidenceSettings,
    Measurements,
    MountedCameras,
    SegmentPoses,
    StateFit,
)
from bodycam_ros.estimation.motion_model import LASTS_S, MotionModel, MotionSettings
from bodycam_ros.estimation.pose_prior import PosePrior
from bodycam_ros.estimation.static_evidence import StaticCameras, StaticEvidence
from bodycam_ros.estimation.whole_recording import SmootherSettings, WholeRecording
from bodycam_ros.kinematics.tangent import TreeTangent

Mask = NDArray[np.bool_]

_BLOCK_S, _OVERLAP_S = 15.0, 1.5  # a whole recording is solved in blocks, each with so much of what follows: memory
_BLIND_WAIT_S = 10.0  # offline, a state waits this long for an unobserved limb to be observed again
CARRIED_S = 5.0
"""The longest gap that accelerometers fill [s]: their errors grow with the square of time."""

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
        on_progress: called with the finished share while a recording is solved as a whole.

    Attributes:
        rejected: camera -> states in which its registration was rejected.
        interpolated: states without any image that were filled in.

    Raises:
        BodyError: no camera is mounted on the body, and there is no static camera.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Collection[str],
        settings: SmootherSettings | None = None,
        motion: MotionSettings | None = None,
        evidence: EvidenceSettings | None = None,
        offline: bool = False,
        coupling: Coupling | None = None,
        contact: ContactSettings | None = None,
        static_cameras: StaticCameras | None = None,
        inertial: InertialSensors | None = None,
        on_progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        self._offline, self._coupling, self._static_cameras = offline, coupling, static_cameras
        self._inertial = inertial
        # Unknown lengths of equipment are joints that slide; their segments come last, and are not published.
        self.body = coupling.body if coupling else body
        self._published = slice(len(body.segments))
        self._published_joints = [self.body.joint_row[joint.name] for joint in body.tree_joints]
        self.settings = settings or SmootherSettings()
        self._cameras = {name for name in cameras if name in body.mounts}
        if not self._cameras and static_cameras is None:
            there, carried = ", ".join(cameras) or "there are none", ", ".join(body.mounts)
            raise BodyError(f"body {body.name}: none of the recording's cameras ({there}) is on it; it has {carried}")
        self._soles = Soles(body, contact or ContactSettings())
        self._mounted = MountedCameras(body, evidence or EvidenceSettings())
        self._tangent = TreeTangent(self.body, SLIDES_M)
        self._motion = MotionModel(self._tangent, motion or MotionSettings())
        coupled = coupling.joint_names if coupling else frozenset[str]()
        self._prior = PosePrior(self.body, coupled)
        self._fit = StateFit(self._tangent, coupled)
        self._gaps = FrameGaps()
        self._whole = WholeRecording(self.body, self._motion, self._fit, self._prior, on_progress)
        self._root = body.segment_index[body.root]
        self.rejected: Counter[str] = Counter()
        self.interpolated = 0
        self._restart()

    def _restart(self) -> None:
        """Forget the motion: at the start, and after a pause that is too long to be filled."""
        self._chain: list[ChainState] = []
        self._static = StaticEvidence(self.body, self._static_cameras, self._published.stop)
        self._whole.reset()
        if self._coupling:
            self._coupling.reset()

    @property
    def has_states(self) -> bool:
        """Whether there is a state that the next one follows from."""
        return bool(self._chain)

    @property
    def period_ns(self) -> float:
        """Of the frames [ns]; infinite before the second."""
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
        if self._chain and frame.stamp_ns - self._chain[-1].stamp_ns > 1e9 * max_pause_s:
            states = self.flush()
            self._restart()
        registered = self._mounted.absolute_evidence(m for name, m in frame.matches.items() if name in self._cameras)
        if not self._chain:
            placed = self._static.place(frame, registered.values())
            if registered or placed:
                self._chain.append(self._first(frame, registered, placed))
        else:
            for stamp_ns in missing_ns:
                self._chain.append(self._next(BodyFrame(stamp_ns, {}), {}))
                self.interpolated += 1
            self._chain.append(self._next(frame, registered))
        return states + self._publish()

    def _max_pause_s(self, stamp_ns: int) -> float:
        """The longest gap before a stamp [ns] that is filled: with inertial sensors on the root, a longer one."""
        longest_s, last_ns = self.settings.max_pause, self._chain[-1].stamp_ns if self._chain else stamp_ns
        if self._inertial is None or stamp_ns - last_ns <= 1e9 * longest_s:
            return longest_s
        return max(longest_s, CARRIED_S) if self._inertial.carry(last_ns, stamp_ns) else longest_s

    def _first(self, frame: BodyFrame, registered: Mapping[str, SegmentPose], placed: list[SegmentPose]) -> ChainState:
        """The first state, where cameras measured the body or it was placed by hand."""
        poses = first_poses(self.body, [*registered.values(), *placed], _BENT)
        initial = self._motion.initial(self.body.motion_of(poses, self._tangent.slides))
        initial = self._coupling.initial(initial) if self._coupling else initial
        return self._solve(frame, registered, Transition.first(initial), placed)

    def _next(self, frame: BodyFrame, registered: Mapping[str, SegmentPose]) -> ChainState:
        """A state after another: the motion prior (A eq. 10-11), and the rotations measured since (A eq. 2)."""
        before, coupling = self._chain[-1], self._coupling
        dt_s = 1e-9 * (frame.stamp_ns - before.stamp_ns)
        needs_turn = ~(before.observed & self.body.named(pose.segment for pose in registered.values()))
        between: list[Between] = []
        if self._inertial is not None:
            self._inertial.observe(frame)
            between += self._inertial.factors(before.stamp_ns, frame.stamp_ns, needs_turn)
        needs_turn[[factor.row for factor in between]] = False
        between += measured_turns(self.body, frame.matches.values(), before.stamps_ns, needs_turn)
        prior = None
        if coupling:
            prior = coupling.motion.prior(coupling.attachments.active)
            between += coupling.standing_points()
        return self._solve(frame, registered, condition(self._motion.predict(before.estimate, dt_s, prior), between))

    def _solve(
        self,
        frame: BodyFrame,
        registered: Mapping[str, SegmentPose],
        link: Transition,
        placed: Sequence[SegmentPose] = (),
    ) -> ChainState:
        """One state: gate the cameras, collect the other measurements, fit, then add contacts."""
        static, ends = self._static, self.body.joint_ends
        accepted, start = self._gate(registered, link)
        known = [*accepted.values(), *placed]
        on_body = self.body.named(pose.segment for pose in accepted.values())
        link, start = self._add_static_cameras(frame, link, start, known, on_body)
        observed, turning = static.observed, static.observed
        turning[[factor.row for factor in link.between if isinstance(factor, SegmentTurn)]] = True
        joints_observed, joints_turning = on_body[ends].all(axis=1), turning[ends].all(axis=1) | (link.dt_s == 0.0)
        # The measurements of this state.
        cameras, by_static = SegmentPoses.from_evidence(self.body, [*known, *static.evidence]), static.joints()
        predicted = self._prior.predict(joints_observed, joints_turning, link.dt_s or LASTS_S)
        measured = Measurements(cameras, predicted.replaced(by_static))
        if self._coupling:
            measured, link, start = self._couple(frame.stamp_ns, on_body | static.rows, measured, link, start)
        # The state that fits them best (A eq. 8, B eq. 15).
        before, link = link.before.at.poses, self._fit.fit(link, measured, start)
        self._prior.add(link.after.at.joints[:, :3, :3], joints_observed, link.dt_s)
        # Points of the soles that rest.
        link = condition(link, self._soles.resting(before, link.after.at.poses, link.dt_s, turning))
        estimate = link.after
        if self._coupling:
            self._coupling.remember(estimate)
        return ChainState(
            stamp_ns=frame.stamp_ns,
            stamps_ns={camera: matches.stamp_ns for camera, matches in frame.matches.items()},
            link=link,
            measured=measured,
            joints_observed=joints_observed,
            turning=joints_turning,
            by_static=by_static,
            observed=observed,
            cameras_used=len(accepted) + static.camera_count,
            uncertainty=static.widen(body_uncertainty(estimate, link.dt_s, bool(observed[self._root]))),
            active=self._coupling.active if self._coupling else None,
        )

    def _gate(
        self, registered: Mapping[str, SegmentPose], link: Transition
    ) -> tuple[dict[str, SegmentPose], Coordinates]:
        """The cameras that pass the chi-square gate, and the coordinates that fit them."""
        poses = SegmentPoses.from_evidence(self.body, registered.values())
        accepted, at = gate_cameras(link, poses, self._unobserved_columns())
        self.rejected.update(name for name, passes in zip(registered, accepted, strict=True) if not passes)
        return {name: pose for (name, pose), passes in zip(registered.items(), accepted, strict=True) if passes}, at

    def _unobserved_columns(self) -> Mask:
        """(K,) coordinates that nothing measured in the state before: no reason to reject a camera that does now."""
        if not self._chain:
            return np.ones(self._tangent.count, bool)
        before = self._chain[-1]
        unobserved = self._tangent.columns_of(~before.joints_observed)
        unobserved[:6] = not before.observed.any()
        return unobserved

    def _add_static_cameras(
        self, frame: BodyFrame, link: Transition, start: Coordinates, known: Sequence[SegmentPose], on_body: Mask
    ) -> tuple[Transition, Coordinates]:
        """Transition and initial coordinates, with limbs where static cameras found them.

        A limb that was searched and found elsewhere did not move there: its motion restarts.
        """
        poses = start.poses
        self._static.measure(frame, poses, link.dt_s, known, on_body)
        if not self._static.rows.any():
            return link, start
        motion, at = self.body.motion_of(self._static.poses(poses), self._tangent.slides), link.after.at
        jumped = self._static.jumped
        joints = jumped[self.body.joint_ends].any(axis=1)
        restarted = np.append(jumped[self._root], joints)
        at = replace(at, motion=np.where(restarted[:, None, None], motion, at.motion))
        columns = self._tangent.columns_of(joints)
        columns[:6] = jumped[self._root]
        return self._motion.restarted(link, at, columns), replace(start, motion=motion)

    def _couple(
        self,
        stamp_ns: int,
        observed: Mask,
        measured: Measurements,
        link: Transition,
        start: Coordinates,
    ) -> tuple[Measurements, Transition, Coordinates]:
        """Measurements and initial estimate with the equipment."""
        coupling = self._coupling
        assert coupling is not None  # by the caller
        start = coupling.update(stamp_ns, start, observed)
        at, columns = coupling.restarted(link.after.at, start, self._chain[-1].active if self._chain else None)
        cameras = measured.cameras + coupling.upright_measurement(start)
        expected = measured.expected + coupling.motion.coasting(at, coupling.active)
        measured = Measurements(cameras, expected, coupling.closed)
        return measured, self._motion.restarted(link, at, columns), start

    def flush(self) -> list[BodyState]:
        """The states that still wait for later frames; the recording is over."""
        return self._publish_until(len(self._chain))

    def _publish(self) -> list[BodyState]:
        """States that need not wait any more."""
        if not self._chain:
            return []
        latest = self._chain[-1]
        for state in self._chain[:-1]:
            state.follow(latest)
        if self.settings.whole_recording:
            if latest.stamp_ns - self._chain[0].stamp_ns < 1e9 * (_BLOCK_S + _OVERLAP_S):
                return []
            end_ns = self._chain[0].stamp_ns + 1e9 * _BLOCK_S
            return self._publish_until(sum(state.stamp_ns < end_ns for state in self._chain))
        until, observed_after = 0, sum(state.is_observed for state in self._chain)
        for state in self._chain:
            observed_after -= state.is_observed
            is_recent = latest.stamp_ns - state.stamp_ns < 1e9 * _BLIND_WAIT_S
            if observed_after < int(self.settings.output_delay) or (self._offline and state.is_waiting and is_recent):
                break
            until += 1
        return self._publish_until(until)

    def _publish_until(self, count: int) -> list[BodyState]:
        """The first ``count`` states; the latest of all stays in the chain, for the next one follows from it."""
        pending = [state for state in self._chain[:count] if not state.is_published]
        if not pending:
            return []
        waiting = [state for state in self._chain if not state.is_published]
        if self.settings.whole_recording:
            smoothed = self._whole.solve(waiting, len(pending), self._coupling)
        else:
            smoothed = smooth(waiting)
        for state in pending:
            state.is_published = True
        self._chain = [state for state in self._chain[:-1] if not state.is_published] + self._chain[-1:]
        return [self._body_state(*each) for each in zip(pending, smoothed, strict=False)]

    def _body_state(self, state: ChainState, at: Coordinates) -> BodyState:
        report, rows, uncertainty = None, self._published, state.uncertainty
        if self._coupling:
            report = self._coupling.report(at, state.estimate.covariance, state.active)
        joints, segments = uncertainty.joints[self._published_joints], uncertainty.segments[rows]
        return BodyState(
            stamp_ns=state.stamp_ns,
            segments=self.body.segments[rows],
            world_T_segment=at.poses[rows].copy(),
            uncertainty=replace(uncertainty, joints=joints, segments=segments),
            observed=state.observed[rows],
            cameras_used=state.cameras_used,
            equipment=report,
        )
