"""The articulated body over a sliding window (A 4.3): cameras, joints and smoothness in one factor graph.

One pose per segment and instant; only gtsam's native factors, so that it never calls back into Python
(DESIGN 4.2). A frame is answered when it is ``output_delay`` frames old, when its neighbours on both sides have spoken.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodyError
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.solving.attachment_watch import Holding
from bodycam_ros.solving.body_covariance import BodyCovariance, CovarianceSettings
from bodycam_ros.solving.body_factors import BodyFactors
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_now import BodyNow
from bodycam_ros.solving.body_state import BodyState
from bodycam_ros.solving.body_window import BodyWindow, Instant
from bodycam_ros.solving.bridge import Silence
from bodycam_ros.solving.camera_evidence import (
    EvidenceSettings,
    MountedCameras,
    SegmentPose,
    SegmentTurn,
    turned,
    weak_evidence,
)
from bodycam_ros.solving.camera_trust import CameraTrust, Trusted, TrustSettings
from bodycam_ros.solving.contact import FootContacts
from bodycam_ros.solving.coupling import Coupling
from bodycam_ros.solving.equipment_recorded import RecordedEquipment
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.forward_states import ForwardStates
from bodycam_ros.solving.going_on import GoingOn
from bodycam_ros.solving.held_joint import HeldJoint
from bodycam_ros.solving.looking_on import LookingOn
from bodycam_ros.solving.motion import MotionSettings
from bodycam_ros.solving.pose_memory import PoseMemory, PoseMemorySettings
from bodycam_ros.solving.recorded_instants import Recorded, RecordedInstant
from bodycam_ros.solving.seen_body import Onlookers
from bodycam_ros.solving.segment_turns import TurnSince, turns_of_unseen
from bodycam_ros.solving.smoother_settings import SmootherSettings
from bodycam_ros.solving.start_poses import hung, led, seated, turned_on_joint
from bodycam_ros.solving.whole_recording import WholeRecording

Array = NDArray[np.float64]


class BodySmoother:
    """Solves the poses of all segments from the registrations of all cameras.

    Args:
        body: segments, joints and mounts.
        cameras: models of the cameras, by name.
        settings, motion, evidence, trust, memory, covariance, pose_fit: settings of the smoother and of its steps.
        offline: states may wait until a limb that is blind is seen again.
        coupling: what the body is coupled to; ``body`` then is the one with the equipment.
        contacts: which feet stand.
        onlookers: static cameras around the body.
        on_progress: told the share that is done while a recording is solved as a whole.

    Attributes:
        refused: camera -> instants at which its registration was not used.

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
        trust: TrustSettings | None = None,
        memory: PoseMemorySettings | None = None,
        covariance: CovarianceSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
        offline: bool = False,
        coupling: Coupling | None = None,
        contacts: FootContacts | None = None,
        onlookers: Onlookers | None = None,
        on_progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        self.body, self._offline, self._on_progress, self._coupling = body, offline, on_progress, coupling
        self._onlookers = onlookers
        self.settings = settings or SmootherSettings()
        self._cameras = {name: camera for name, camera in cameras.items() if name in body.mounts}
        if not self._cameras and onlookers is None:
            there, carried = ", ".join(cameras) or "there are none", ", ".join(body.mounts)
            raise BodyError(f"body {body.name}: none of the recording's cameras ({there}) is on it; it has {carried}")
        self._motion = motion or MotionSettings()
        self._evidence = evidence or EvidenceSettings()
        self._mounted = MountedCameras(body, self._evidence)
        self._trust_settings = trust or TrustSettings()
        self._covariance_settings = covariance or CovarianceSettings()
        self._pose_fit = pose_fit or PoseFitSettings()
        self._coupled = coupling.joint_names if coupling else frozenset[str]()
        self._factors = BodyFactors(body, self.settings.outlier_sigmas, self._coupled)
        self._window = BodyWindow(self._factors, self.settings)
        self._going_on = GoingOn(body, self._window, self._factors, self._motion, coupling)
        self._beside = frozenset(coupling.rows.tolist()) if coupling else frozenset[int]()
        self._memory = PoseMemory(body, memory or PoseMemorySettings(), self._coupled)
        self._contacts = contacts or FootContacts(body)
        self._silence = Silence(self.settings.max_pause)
        self.refused: Counter[str] = Counter()
        self._bridged_before = 0
        self._begin_anew()

    @property
    def bridged(self) -> int:
        """Instants without any image that were filled in."""
        return self._bridged_before + self._outgoing.bridged

    @property
    def restarts(self) -> int:
        """How often the solver could not solve its window and began anew."""
        return self._window.restarts

    @property
    def lately(self) -> list[BodyNow]:
        """The body at the latest two instants, as far as there are, oldest first."""
        return self._window.lately

    def _begin_anew(self) -> None:
        """An empty window: at the start, and after a pause that nothing reaches across."""
        self._window.clear()
        self._published = -1
        self._trust = CameraTrust(self.body, self.settings.outlier_sigmas, self._trust_settings, self._motion)
        self._uncertainty = BodyCovariance(self.body, self._motion, self._covariance_settings, self._coupled)
        self._jumped: frozenset[int] = frozenset()
        self._looking_on = LookingOn(self.body, self._onlookers)
        if self._coupling:
            self._coupling.begin_anew()
        self._outgoing = self.outgoing()

    def outgoing(self) -> ForwardStates | WholeRecording:
        """Where instants wait, once the window is done with them, until their states are published."""
        density, turn_sigma = self._uncertainty.density, self._evidence.blind_rotation_sigma
        if not self.settings.whole_recording:
            longest_s = self.settings.blind_hold if self._offline else 0.0
            return ForwardStates(self.body, longest_s, turn_sigma, density)
        equipment = RecordedEquipment(self.body, self._coupling, self._factors) if self._coupling else None
        solved = self.body, self._factors, self._memory, self._motion
        return WholeRecording(*solved, density, turn_sigma, self.settings, self._on_progress, equipment)

    def join(self, camera: str, model: CameraModel) -> None:
        """Use one more camera of the body from now on, or another model of one."""
        self._cameras[camera] = model

    def update(self, frame: BodyFrame) -> list[BodyState]:
        """Add one instant, later than the one before.

        Returns:
            The states that are now old enough to publish; empty until a camera is registered, or the body placed.
        """
        if self._coupling:
            self._coupling.begin(frame.stamp_ns)
        registered = self._mounted.absolute_evidence(m for name, m in frame.matches.items() if name in self._cameras)
        states = self._publish_before(frame.stamp_ns)
        placed = [] if self._window.instants else self._looking_on.begin(frame, registered.values())
        if not self._window.instants and not registered and not placed:
            return states
        index = self._window.instants[-1].index + 1 if self._window.instants else 0
        dt_s = 1e-9 * (frame.stamp_ns - self._window.instants[-1].stamp_ns) if index else 0.0
        moved = self._going_on.predict(frame.stamp_ns, dt_s, self._jumped)
        trusted = self._trust.judge(registered, moved, frame.stamp_ns)
        self.refused.update(trusted.refused)
        path = moved if moved is not None else self._going_on.begin([*trusted.evidence.values(), *placed])
        seen_by_pose = {seen.segment for seen in trusted.evidence.values()}
        measured = list(turns_of_unseen(self.body, frame, self._window.instants, seen_by_pose, self._evidence))
        turns = self._predict_turns(measured, seen_by_pose, path)
        evidence = trusted.evidence | self._weak_evidence(frame, trusted, path)
        observed = self.body.named(seen.segment for seen in evidence.values())
        joints_seen = observed[self.body.joint_ends].all(axis=1)
        known = observed | self._looking_on.rows | self.body.named(turn.segment for _, turn in turns)
        known[list(self._beside)] = True
        turning = known[self.body.joint_ends].all(axis=1)
        self._memory.machine_is_known = bool(self._coupling and self._coupling.placed)
        expected = self._memory.expect(self.body.joint_rotations(path), joints_seen, turning, dt_s)
        path = self._hang(path, known, expected)
        self._looking_on.look(frame, path, dt_s, [*evidence.values(), *placed])
        expected = expected.told(told := self._looking_on.told(observed))
        start = seated(self._looking_on.path(path, observed), trusted.seats)
        self._jumped = trusted.jumped | self._looking_on.seen.jumped
        said = [*evidence.values(), *placed, *self._looking_on.evidence]
        held, holding = self._couple(frame.stamp_ns, dt_s, start, self._looking_on.with_worn(trusted.evidence))
        factors = {
            "cameras": self._factors.cameras(index, said),
            "turns": self._factors.turns(index, turns),
            "joints": self._factors.joints(index, start, expected),
            "past": self._going_on.past(index, dt_s, path, start),
            "contacts": self._contacts.factors(self._window, self._factors.key),
            "equipment": self._factors.equipment(index, start, held),
        }
        uncertainty = self._uncertainty.update(dt_s, start, said, [turn for _, turn in turns], expected, held)
        stamps_ns = {camera: matches.stamp_ns for camera, matches in frame.matches.items()}
        silent_ns = self._silence.missing(frame)[: None if index else 0]
        steps = {t.row: t.turn.previous_R_segment for t in measured if t.since.index == index - 1 and not silent_ns}
        joints = partial(self._factors.joints, index)
        recorded = Recorded(factors, joints, joints_seen, turning, told, steps, silent_ns, trusted.refused, holding)
        observed, speaking = observed | self._looking_on.rows, len(evidence) + self._looking_on.speaking
        instant = Instant(index, frame.stamp_ns, stamps_ns, start, observed, speaking, uncertainty, recorded)
        self._window.add(instant, factors)
        self._going_on.learn_speeds(dt_s)
        self._memory.remember(self.body.joint_rotations(instant.world_T_segment), joints_seen, dt_s)
        return states + self._publish(self.settings.frames_behind)

    def flush(self) -> list[BodyState]:
        """The states that were still waiting for later frames; the recording is over."""
        if self._window.instants:
            self._window.settle()
        return self._publish(0) + self._outgoing.flush()

    def _publish_before(self, stamp_ns: int) -> list[BodyState]:
        """All states, if the next instant comes after a pause that nothing reaches across."""
        if not self._window.instants or stamp_ns - self._window.instants[-1].stamp_ns <= 1e9 * self.settings.max_pause:
            return []
        states = self.flush()
        self._bridged_before = self.bridged
        self._begin_anew()
        return states

    def _predict_turns(
        self, measured: Iterable[TurnSince], seen: set[str], path: Array
    ) -> list[tuple[int, SegmentTurn]]:
        """Turns of the segments that are not seen, and since which instant; their path is turned, in place."""
        turns = []
        for said in measured:
            if said.turn.segment not in seen and self._window.reaches(said.since.index):
                turns.append((said.since.index, said.turn))
                path[said.row] = turned(self._window.poses(said.since)[said.row], said.turn, path[said.row])
        return turns

    def _hang(self, path: Array, known: NDArray[np.bool_], expected: ExpectedJoints) -> Array:
        """Poses (S, 4, 4) in which what is not known hangs on its joint, turned no farther than the joint turns.

        It moves as it did when it was last seen at first, and more and more as is expected of it.
        """
        if known.all():
            return path
        rotations = self.body.joint_rotations(path)
        if self._window.instants and len(expected.rows):
            before = self.body.joint_rotations(self._window.poses(self._window.instants[-1]))
            rotations = led(rotations, before, expected)
        return hung(self.body, path, self._memory.within_limits(rotations), known)

    def _couple(
        self, stamp_ns: int, dt_s: float, start: Array, seen: Mapping[str, SegmentPose]
    ) -> tuple[list[HeldJoint], Holding | None]:
        """What couples the body to its equipment, which is put into the start values (S, 4, 4), in place."""
        if self._coupling is None:
            return [], None
        self._coupling.follow(stamp_ns, dt_s, start, seen)
        return self._coupling.places.joints(start, self._coupling.holding), self._coupling.holding

    def _weak_evidence(self, frame: BodyFrame, trusted: Trusted, path: Array) -> dict[str, SegmentPose]:
        """What cameras say that are not registered, and what the refused ones say when they are asked again."""
        weak = {}
        for camera, matches in frame.matches.items():
            if camera not in self._cameras or camera in trusted.evidence:
                continue
            mount, settings = self.body.mounts[camera], self._evidence
            start = path[self.body.segment_index[mount.segment]]
            if camera in trusted.refused:
                start = turned_on_joint(self.body, matches, trusted.evidence.values(), path)
                settings = replace(settings, max_weak_shift=self._trust_settings.max_gap)
            seen = weak_evidence(matches, self._cameras[camera], mount, start, self._pose_fit, settings)
            if seen:
                weak[camera] = seen
        return weak

    def _publish(self, delay: int) -> list[BodyState]:
        """States of the instants that at least ``delay`` others have followed."""
        states = []
        for position, instant in enumerate(self._window.instants):
            if self._published < instant.index <= self._window.instants[-1].index - delay:
                after = islice(self._window.instants, position + 1, position + 2)
                following = [self._state(later) for later in after if instant.recorded.missing_ns]
                leaving = RecordedInstant(instant.index, self._state(instant), instant.recorded)
                states += self._outgoing.add(leaving, following)
                self._published = instant.index
        return states

    def _state(self, instant: Instant) -> BodyState:
        poses, known = self._window.poses(instant), instant.uncertainty
        report = self._coupling.report(poses, instant.recorded.holding) if self._coupling else None
        return BodyState(
            instant.stamp_ns, self.body.segments, poses, known, instant.observed, instant.cameras_used, report
        )
