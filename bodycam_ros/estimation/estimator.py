"""The articulated body from the measurements of all cameras (A 4.3): forwards instant by instant, then backwards.

The instants are a chain, and the chain is a factor graph: a motion prior between neighbours (A eq. 10-11), poses of
segments (A eq. 8) and joints of equipment (B eq. 15) at each. Going forwards each instant is predicted, judged and
fitted; going backwards each takes over what later ones know. Delay 0, 2, 4 frames or the whole recording differ in how
far back that goes.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, BodyNow, BodyState, SegmentPose
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.belief import Belief, Coordinates, Link, body_uncertainty
from bodycam_ros.estimation.camera_judge import REFUSED, judge
from bodycam_ros.estimation.contact import ContactSettings, FootContacts
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.instant import Instant, Step, first_poses, smoothed
from bodycam_ros.estimation.looking_on import LookingOn, Onlookers
from bodycam_ros.estimation.measurements import (
    SLIDES_M,
    ClosedJoint,
    EvidenceSettings,
    InstantFit,
    Measured,
    MountedCameras,
    SegmentPoses,
)
from bodycam_ros.estimation.motion_model import MotionModel, MotionSettings, freed, given, turns_since
from bodycam_ros.estimation.pose_prior import PosePrior
from bodycam_ros.estimation.whole_recording import SmootherSettings, WholeRecording
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent

_REMEMBERED = 15  # frames whose period is remembered: a single odd one does not count
_SILENT = 1.5  # periods: one missed image is at two


class Silence:
    """Learns the period of the cameras by their own stamps, so that cameras that run freely do not look faster.

    Args:
        max_pause_s: a longer silence is not filled.
    """

    def __init__(self, max_pause_s: float) -> None:
        self._max_pause_ns = 1e9 * max_pause_s
        self._periods_ns: deque[float] = deque(maxlen=_REMEMBERED)
        self._last_ns: int | None = None

    def missing(self, frame: BodyFrame) -> tuple[int, ...]:
        """Stamps [ns] between the instant before and this one at which images are missing."""
        last_ns, self._last_ns = self._last_ns, frame.stamp_ns
        own_ns = [m.stamp_ns - m.previous_stamp_ns for m in frame.matches.values() if m.previous_stamp_ns]
        period_ns = median(self._periods_ns) if self._periods_ns else None
        if own_ns:
            self._periods_ns.append(median(own_ns))
        pause_ns = frame.stamp_ns - last_ns if last_ns is not None else 0
        if period_ns is None or not _SILENT * period_ns < pause_ns <= self._max_pause_ns or last_ns is None:
            return ()
        steps = round(pause_ns / period_ns)
        return tuple(last_ns + round(pause_ns * step / steps) for step in range(1, steps))


Mask = NDArray[np.bool_]

_FIRST_S = 0.033
"""How long the first instant lasts, as a measurement among others."""


class BodyEstimator:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: models of the cameras, by name.
        settings, motion, evidence: settings of the estimator and of its steps.
        offline: states may wait until a limb that is blind is seen again.
        coupling: what the body is coupled to; ``body`` then is the one with the equipment.
        contacts: tells which points of the soles stand.
        onlookers: static cameras around the body.
        on_progress: told the share that is done while a recording is solved as a whole.

    Attributes:
        refused: camera -> instants at which its registration was doubted, or not used at all.
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
        offline: bool = False,
        coupling: Coupling | None = None,
        contacts: FootContacts | None = None,
        onlookers: Onlookers | None = None,
        on_progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        self.body, self._offline, self._coupling, self._onlookers = body, offline, coupling, onlookers
        self.settings = settings or SmootherSettings()
        self._cameras = {name for name in cameras if name in body.mounts}
        if not self._cameras and onlookers is None:
            there, carried = ", ".join(cameras) or "there are none", ", ".join(body.mounts)
            raise BodyError(f"body {body.name}: none of the recording's cameras ({there}) is on it; it has {carried}")
        self._evidence = evidence or EvidenceSettings()
        self._contacts = contacts or FootContacts(body, ContactSettings())
        self._mounted = MountedCameras(body, self._evidence)
        self._tangent = TreeTangent(body, SLIDES_M)
        self._slides = np.array([xi[3:].any(axis=1) for xi in self._tangent.twists], bool).reshape(-1, 3)
        self._motion = MotionModel(self._tangent, motion or MotionSettings())
        coupled = coupling.joint_names if coupling else frozenset[str]()
        self._prior = PosePrior(body, coupled)
        self._of_people = np.array([joint.name not in coupled for joint in body.tree_joints], bool)
        self._fit = InstantFit(self._tangent, lambda: self._prior.limits, coupled)
        self._silence = Silence(self.settings.max_pause)
        self._whole = WholeRecording(body, self._tangent, self._motion, self._fit, self._prior, on_progress)
        self.refused: Counter[str] = Counter()
        self.bridged = 0
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Nothing is known of the motion: at the start, and after a pause that nothing reaches across."""
        self._instants: list[Instant] = []
        self._looking_on = LookingOn(self.body, self._onlookers)
        self._contacts.begin_anew()
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
        return self._solve(frame, registered, Step(0.0, begun), placed)

    def _next(self, frame: BodyFrame, registered: Mapping[str, SegmentPose]) -> Instant:
        """An instant after another: the motion prior, and what cameras measured of both (A eq. 10-11, eq. 2)."""
        before = self._instants[-1]
        dt_s = 1e-9 * (frame.stamp_ns - before.stamp_ns)
        density, fade_s = self._coupling.motion(self._motion, self._tangent) if self._coupling else (None, None)
        link = self._motion.predict(before.belief, dt_s, density, fade_s)
        turns = turns_since(
            self.body,
            frame.matches.values(),
            before.stamps_ns,
            lambda camera, row: camera not in registered or not before.observed[row],
            self._evidence.blind_rotation_sigma,
        )
        link = given(freed(link, turns, self._tangent), turns, self._tangent)
        return self._solve(frame, registered, Step(dt_s, link.after, link, density, fade_s, turns))

    def _solve(
        self, frame: BodyFrame, registered: Mapping[str, SegmentPose], step: Step, placed: Sequence[SegmentPose] = ()
    ) -> Instant:
        """One instant: which cameras are believed, what else is known, the fit, and what stands."""
        believed, step, start = self._judged(registered, step)
        observed = self.body.named(seen.segment for seen in believed.values())
        step, path, start = self._looked_on(frame, step, start, [*believed.values(), *placed], observed)
        others = [*placed, *self._looking_on.evidence]
        cameras = SegmentPoses.of(self.body, [*believed.values(), *others])
        turning = observed | self._looking_on.rows | self.body.named(self.body.segments[t.row] for t in step.between)
        ends = self.body.joint_ends
        joints_seen, joints_turning = observed[ends].all(axis=1), turning[ends].all(axis=1) | (step.link is None)
        told = self._looking_on.told(observed)
        expected = self._prior.expect(
            self.body.joint_rotations(path), joints_seen, joints_turning, step.dt_s or _FIRST_S
        ).replaced(told.which, told.rotations, told.sigma)
        closed: tuple[ClosedJoint, ...] = ()
        if self._coupling:
            self._coupling.follow(frame.stamp_ns, step.dt_s, path, self._looking_on.with_worn(believed))
            self._prior.machine_is_known = self._coupling.placed
            step, start = self._seated(step, start, path)
            closed = tuple(self._coupling.places.joints(path, self._coupling.holding))
            expected = expected + self._coupling.coasting(step.after.at)
            cameras = cameras + self._coupling.standing_still()
        is_blind = not (observed.any() or self._looking_on.rows.any())
        measured = Measured(cameras, expected, ~joints_turning & self._of_people & (not is_blind), closed)
        belief = self._fit.fit(step.after, measured, start)
        self._prior.remember(self.body.joint_rotations(belief.at.poses(self._tangent)), joints_seen, step.dt_s)
        observed = observed | self._looking_on.rows
        step, belief = self._stood(frame.stamp_ns, step, belief, observed, turning)
        root_seen = bool(observed[self._row(self.body.root)])
        instant = Instant(
            stamp_ns=frame.stamp_ns,
            stamps_ns={camera: matches.stamp_ns for camera, matches in frame.matches.items()},
            belief=belief,
            step=step,
            measured=measured,
            joints_seen=joints_seen,
            turning=joints_turning,
            told=told,
            observed=observed,
            cameras_used=len(believed) + self._looking_on.speaking,
            uncertainty=body_uncertainty(belief, self._tangent, step.dt_s, root_seen),
            holding=self._coupling.holding if self._coupling else None,
        )
        self._remember_lately(instant)
        return instant

    def _judged(
        self, registered: Mapping[str, SegmentPose], step: Step
    ) -> tuple[Mapping[str, SegmentPose], Step, Coordinates]:
        """The cameras that are believed, and where they have the body.

        A joint that was guessed, and is seen far from there, did not move so in one instant: it begins anew.
        """
        guessed = self._guessed()
        worn = SegmentPoses.of(self.body, registered.values())
        judged = judge(step.after, worn, self._tangent, guessed)
        start, believed = judged.at, {}
        for (name, seen), trust in zip(registered.items(), judged.trust.tolist(), strict=True):
            self.refused[name] += int(trust < 1.0)
            if trust > 0.0:
                believed[name] = replace(seen, covariance=seen.covariance / trust)
        apart = step.after.at.step_to(self._tangent, start)
        anew, motion = np.zeros(self._tangent.count, bool), step.after.at.motion.copy()
        for row in np.flatnonzero(
            self.body.named(seen.segment for seen in believed.values())[self.body.joint_ends].all(axis=1)
        ):
            at = self._tangent.columns[row]
            if guessed[at].any() and apart[at] @ np.linalg.solve(step.after.covariance[at, at], apart[at]) > REFUSED:
                anew[at], motion[row] = True, start.motion[row]
        return believed, self._begun_again(step, replace(step.after.at, motion=motion), anew), start

    def _looked_on(
        self, frame: BodyFrame, step: Step, start: Coordinates, known: Sequence[SegmentPose], observed: Mask
    ) -> tuple[Step, Array, Coordinates]:
        """Poses (S, 4, 4) and coordinates to start from, with limbs where static cameras have them.

        A limb that they found somewhere else than before did not move there: its motion begins anew.
        """
        path = start.poses(self._tangent)
        self._looking_on.look(frame, path, step.dt_s, known)
        if not self._looking_on.rows.any():
            return step, path, start
        path = self._looking_on.path(path, observed)
        root, motion = path[self._row(self.body.root)], self.body.joint_poses(path, self._slides)
        start = replace(start, root=root, motion=motion)
        jumped = np.zeros(len(path), bool)
        jumped[list(self._looking_on.seen.jumped)] = True
        jumped &= ~observed
        joints = jumped[self.body.joint_ends].any(axis=1)
        at = replace(step.after.at, motion=np.where(joints[:, None, None], motion, step.after.at.motion))
        columns = np.zeros(self._tangent.count, bool)
        if jumped[self._row(self.body.root)]:
            at, columns[:6] = replace(at, root=root), True
        for row in np.flatnonzero(joints):
            columns[self._tangent.columns[row]] = True
        return self._begun_again(step, at, columns), path, start

    def _seated(self, step: Step, start: Coordinates, path: Array) -> tuple[Step, Coordinates]:
        """The equipment where it was found, of which some begins anew."""
        assert self._coupling is not None
        before = self._instants[-1].holding if self._instants else None
        columns = self._coupling.begins_anew(self._tangent, before)
        start = self._coupling.seated(start, path, self._slides)
        if not columns.any():
            return step, start
        return self._begun_again(step, self._coupling.seated(step.after.at, path, self._slides), columns), start

    def _begun_again(self, step: Step, at: Coordinates, columns: Mask) -> Step:
        """A step after which some columns (K,) are elsewhere, and nothing is known of how they came there."""
        if not columns.any():
            return step
        after = self._motion.begun_again(step.after, at, columns)
        if step.link is None:
            return replace(step, after=after)
        cross = step.link.cross.copy()
        cross[np.concatenate([columns, columns])] = 0.0
        return step.linked(Link(step.link.before, after, cross))

    def _stood(self, stamp_ns: int, step: Step, belief: Belief, observed: Mask, turning: Mask) -> tuple[Step, Belief]:
        """What is known of an instant, and of the one before, where points of soles stand."""
        standing = self._contacts.standing(stamp_ns, belief.at.poses(self._tangent), observed, turning)
        if standing and step.link is not None:
            link = given(step.link.fitted(self._tangent, belief), standing, self._tangent)
            step, belief = replace(step, link=link, between=[*step.between, *standing]), link.after
        self._contacts.remember(stamp_ns, belief.at.poses(self._tangent))
        return step, belief

    def _row(self, segment: str) -> int:
        return self.body.segment_index[segment]

    def _guessed(self) -> Mask:
        """(K,) coordinates that nothing saw at the instant before: no reason to refuse who sees them now."""
        if not self._instants:
            return np.ones(self._tangent.count, bool)
        before = self._instants[-1]
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
        return self._publish_until(len(self._instants))

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

    def _publish_until(self, count: int) -> list[BodyState]:
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
