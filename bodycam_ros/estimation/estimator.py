"""The articulated body from the measurements of all cameras (A 4.3): forwards instant by instant, then backwards.

The instants are a chain, and the chain is a factor graph: a motion prior between neighbours (A eq. 10-11), poses of
segments (A eq. 8) and joints of equipment (B eq. 15) at each. Going forwards each instant is predicted, judged and
fitted; going backwards each takes over what later ones know. Delay 0, 2, 4 frames or the whole recording differ in how
far back that goes.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.belief import Belief, Coordinates, Link
from bodycam_ros.estimation.body_frame import BodyFrame
from bodycam_ros.estimation.body_now import BodyNow
from bodycam_ros.estimation.body_state import BodyState
from bodycam_ros.estimation.body_uncertainty import CovarianceSettings, body_uncertainty
from bodycam_ros.estimation.camera_evidence import EvidenceSettings, MountedCameras, SegmentPose
from bodycam_ros.estimation.camera_judge import judge
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.first_poses import first_poses
from bodycam_ros.estimation.instant import Instant, smoothed
from bodycam_ros.estimation.looking_on import LookingOn
from bodycam_ros.estimation.measurements import SLIDES_M, InstantFit, Measured, SegmentPoses
from bodycam_ros.estimation.motion_model import MotionModel, MotionSettings
from bodycam_ros.estimation.pose_prior import PoseMemorySettings, PosePrior
from bodycam_ros.estimation.seen_body import Onlookers
from bodycam_ros.estimation.silence import Silence
from bodycam_ros.estimation.smoother_settings import SmootherSettings
from bodycam_ros.estimation.turns import turned, turns_since
from bodycam_ros.estimation.whole_recording import WholeRecording
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent

_FIRST_S = 0.033
"""How long the first instant lasts, as a measurement among others."""


class BodyEstimator:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: models of the cameras, by name.
        settings, motion, evidence, memory, covariance: settings of the estimator and of its steps.
        offline: states may wait until a limb that is blind is seen again.
        coupling: what the body is coupled to; ``body`` then is the one with the equipment.
        onlookers: static cameras around the body.
        on_progress: told the share that is done while a recording is solved as a whole.

    Attributes:
        refused: camera -> instants at which its registration was not used.
        bridged: instants without any image that were filled in.
        lately: the body at the latest two instants, oldest first, before later ones improved it.

    Raises:
        BodyError: no camera is mounted on the body, and none looks at it.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        settings: SmootherSettings | None = None,
        motion: MotionSettings | None = None,
        evidence: EvidenceSettings | None = None,
        memory: PoseMemorySettings | None = None,
        covariance: CovarianceSettings | None = None,
        offline: bool = False,
        coupling: Coupling | None = None,
        onlookers: Onlookers | None = None,
        on_progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        self.body, self._offline, self._coupling, self._onlookers = body, offline, coupling, onlookers
        self.settings = settings or SmootherSettings()
        self._cameras = {name for name in cameras if name in body.mounts}
        if not self._cameras and onlookers is None:
            there, carried = ", ".join(cameras) or "there are none", ", ".join(body.mounts)
            raise BodyError(f"body {body.name}: none of the recording's cameras ({there}) is on it; it has {carried}")
        self._evidence, self._covariance = evidence or EvidenceSettings(), covariance or CovarianceSettings()
        self._mounted = MountedCameras(body, self._evidence)
        self._tangent = TreeTangent(body, SLIDES_M)
        self._slides = np.array([xi[3:].any(axis=1) for xi in self._tangent.twists], bool).reshape(-1, 3)
        self._motion = MotionModel(self._tangent, motion or MotionSettings())
        coupled = coupling.joint_names if coupling else frozenset[str]()
        self._prior = PosePrior(body, memory or PoseMemorySettings(), coupled)
        self._of_people = np.array([joint.name not in coupled for joint in body.tree_joints], bool)
        self._fit = InstantFit(self._tangent, lambda: self._prior.limits)
        self._silence = Silence(self.settings.max_pause)
        self._whole = WholeRecording(body, self._tangent, self._motion, self._fit, self._prior, on_progress)
        self.refused: Counter[str] = Counter()
        self.bridged = 0
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Nothing is known of the motion: at the start, and after a pause that nothing reaches across."""
        self._instants: list[Instant] = []
        self._looking_on = LookingOn(self.body, self._onlookers)
        self._whole.begin_anew()
        self.lately: list[BodyNow] = []
        if self._coupling:
            self._coupling.begin_anew()

    def join(self, camera: str) -> None:
        """Use one more camera of the body from now on."""
        self._cameras.add(camera)

    def update(self, frame: BodyFrame) -> list[BodyState]:
        """Add one instant, later than the one before.

        Returns:
            The states that are now old enough to publish; empty until a camera is registered, or the body placed.
        """
        if self._coupling:
            self._coupling.begin(frame.stamp_ns)
        states = []
        missing_ns = self._silence.missing(frame)
        if self._instants and frame.stamp_ns - self._instants[-1].stamp_ns > 1e9 * self.settings.max_pause:
            states = self.flush()
            self._begin_anew()
        registered = self._mounted.absolute_evidence(m for name, m in frame.matches.items() if name in self._cameras)
        if not self._instants:
            placed = self._looking_on.begin(frame, registered.values())
            if registered or placed:
                self._instants.append(self._first(frame, registered, placed))
        else:
            for stamp_ns in missing_ns:
                self._instants.append(self._next(BodyFrame(stamp_ns, {}), {}))
                self.bridged += 1
            self._instants.append(self._next(frame, registered))
        return states + self._publish()

    def _first(self, frame: BodyFrame, registered: Mapping[str, SegmentPose], placed: list[SegmentPose]) -> Instant:
        """The instant at which the body begins, where cameras or somebody by hand have it."""
        poses = first_poses(self.body, [*registered.values(), *placed])
        begun = self._motion.begin(poses[self._row(self.body.root)], self.body.joint_poses(poses, self._slides))
        return self._solve(frame, registered, None, begun, placed)

    def _next(self, frame: BodyFrame, registered: Mapping[str, SegmentPose]) -> Instant:
        """An instant after another."""
        before = self._instants[-1]
        dt_s = 1e-9 * (frame.stamp_ns - before.stamp_ns)
        own = self._coupling.motion(self._motion, self._tangent) if self._coupling else ()
        link = self._motion.predict(before.belief, dt_s, *own)
        turns = turns_since(
            self.body,
            frame.matches.values(),
            before.stamps_ns,
            lambda camera, row: camera not in registered or not before.observed[row],
            self._evidence.blind_rotation_sigma,
        )
        return self._solve(frame, registered, turned(link, turns, self._tangent), None, [], turns, own)

    def _solve(self, frame, registered, link, begun, placed, turns=(), own=()) -> Instant:  # noqa
        before = self._instants[-1] if self._instants else None
        predicted = begun or link.after
        dt_s = 1e-9 * (frame.stamp_ns - before.stamp_ns) if before else 0.0
        # Which cameras are believed, and where they have the body.
        worn = SegmentPoses.of(self.body, registered.values())
        kept, start = judge(predicted, worn, self._tangent, self._guessed(before))
        self.refused.update(refused := [name for name, used in zip(registered, kept.tolist(), strict=True) if not used])
        believed = {name: seen for name, seen in registered.items() if name not in refused}
        observed = self.body.named(seen.segment for seen in believed.values())
        path = start.poses(self._tangent)
        # What static cameras see.
        self._looking_on.look(frame, path, dt_s, [*believed.values(), *placed])
        if self._looking_on.rows.any():
            path = self._looking_on.path(path, observed)
            start = replace(start, motion=self.body.joint_poses(path, self._slides))
            start = replace(start, root=path[self._row(self.body.root)])
        cameras = worn.only(kept) + SegmentPoses.of(self.body, [*placed, *self._looking_on.evidence])
        known = observed | self._looking_on.rows | self.body.named(self.body.segments[t.row] for t in turns)
        ends = self.body.joint_ends
        joints_seen, turning = observed[ends].all(axis=1), known[ends].all(axis=1) | (before is None)
        # What nothing sees, and what holds equipment.
        rotations = self.body.joint_rotations(path)
        expected = self._prior.expect(rotations, joints_seen, turning, dt_s or _FIRST_S)
        told = self._looking_on.told(observed)
        expected = expected.replaced(told.which, told.rotations, told.sigma)
        closed, holding = (), None
        if self._coupling:
            self._coupling.follow(frame.stamp_ns, dt_s, path, self._looking_on.with_worn(believed))
            holding = self._coupling.holding
            self._prior.machine_is_known = self._coupling.placed
            start = self._coupling.seated(start, path, self._slides)
            if not self._coupling.went_on:
                columns = self._coupling.columns(self._tangent)
                after = self._motion.begun_again(
                    predicted, self._coupling.seated(predicted.at, path, self._slides), columns
                )
                predicted = after
                if link is not None:
                    cross = link.cross.copy()
                    cross[np.concatenate([columns, columns])] = 0.0
                    link = Link(link.before, after, cross)
            closed = tuple(self._coupling.places.joints(path, holding))
            cameras = cameras + self._coupling.standing_still()
        is_blind = not (observed.any() or self._looking_on.rows.any())
        guessed = ~turning & self._of_people & (not is_blind)
        measured = Measured(cameras, expected, guessed, closed)
        belief = self._fit.fit(predicted, measured, start)
        rotations = self.body.joint_rotations(belief.at.poses(self._tangent))
        self._prior.remember(rotations, joints_seen, dt_s)
        observed = observed | self._looking_on.rows
        root_seen = bool(observed[self._row(self.body.root)])
        instant = Instant(
            stamp_ns=frame.stamp_ns,
            stamps_ns={camera: matches.stamp_ns for camera, matches in frame.matches.items()},
            belief=belief,
            link=link,
            measured=measured,
            turns=list(turns),
            own_motion=own,
            joints_seen=joints_seen,
            turning=turning,
            told=told,
            observed=observed,
            cameras_used=len(believed) + self._looking_on.speaking,
            uncertainty=body_uncertainty(belief, self._tangent, self._covariance, dt_s, root_seen),
            holding=holding,
        )
        self._remember_lately(instant)
        return instant

    def _row(self, segment: str) -> int:
        return self.body.segment_index[segment]

    def _guessed(self, before: Instant | None) -> Array:
        """(K,) coordinates that nothing saw at the instant before: no reason to refuse who sees them now."""
        if before is None:
            return np.ones(self._tangent.count, bool)
        guessed = np.zeros(self._tangent.count, bool)
        guessed[:6] = not before.observed.any()
        for row in np.flatnonzero(~before.joints_seen):
            guessed[self._tangent.columns[row]] = True
        return guessed

    def _remember_lately(self, instant: Instant) -> None:
        poses = instant.belief.at.poses(self._tangent)
        now = BodyNow(instant.stamp_ns, poses, instant.uncertainty.segments, instant.observed)
        self.lately = [*self.lately[-1:], now]

    def flush(self) -> list[BodyState]:
        """The states that were still waiting for later frames; the recording is over."""
        states = self._publish_until(len(self._instants), is_over=True)
        return states

    def _publish(self) -> list[BodyState]:
        """States that wait for nothing any more."""
        if not self._instants:
            return []
        latest = self._instants[-1]
        for instant in self._instants[:-1]:
            instant.follow(latest)
        if self.settings.whole_recording:
            span_s = 1e-9 * (latest.stamp_ns - self._instants[0].stamp_ns)
            if span_s < self.settings.block + self.settings.overlap:
                return []
            end_ns = self._instants[0].stamp_ns + 1e9 * self.settings.block
            return self._publish_until(sum(i.stamp_ns < end_ns for i in self._instants))
        until, seen_after = 0, sum(i.is_observed for i in self._instants)
        for instant in self._instants:
            seen_after -= instant.is_observed
            held_s = 1e-9 * (latest.stamp_ns - instant.stamp_ns)
            waits = self._offline and instant.is_waiting and held_s < self.settings.blind_hold
            if seen_after < self.settings.frames_behind or waits:
                break
            until += 1
        return self._publish_until(until)

    def _publish_until(self, count: int, is_over: bool = False) -> list[BodyState]:
        """States of the first instants that wait; the latest of all stays, for the next goes on from it."""
        pending = [instant for instant in self._instants[:count] if not instant.is_published]
        if not pending:
            return []
        waiting = [instant for instant in self._instants if not instant.is_published]
        if self.settings.whole_recording:
            beliefs = self._whole.solve(waiting, len(pending), self._coupling)
        else:
            beliefs = smoothed(waiting, self._tangent)
        states = [self._state(instant, belief) for instant, belief in zip(pending, beliefs, strict=False)]
        for instant in pending:
            instant.is_published = True
        self._instants = [i for i in self._instants[:-1] if not i.is_published] + self._instants[-1:]
        return states

    def _state(self, instant: Instant, belief: Belief) -> BodyState:
        poses = belief.at.poses(self._tangent)
        report = self._coupling.report(poses, instant.holding) if self._coupling else None
        return BodyState(
            instant.stamp_ns,
            self.body.segments,
            poses,
            instant.uncertainty,
            instant.observed,
            instant.cameras_used,
            report,
        )


__all__ = ["BodyEstimator", "Coordinates"]
