"""The stages wired together once, for the offline replay and for the live nodes alike.

    image --FeatureTracker--> TrackFrame --Registrar--> LandmarkMatches --FrameAssembler, BodyEstimator--> BodyOutput

What happens to one camera is in ``pipeline/camera.py``; ``SkeletonPipeline`` is what happens to all cameras'
registrations.
"""

from collections.abc import Callable, Collection, Iterable, Mapping

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, fitted_equipment
from bodycam_ros.body_state import BodyFrame, BodyOutput, BodyState
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.estimator import CARRIED_S, BodyEstimator
from bodycam_ros.estimation.inertial_factors import InertialSensors
from bodycam_ros.estimation.mounted_cameras import evidence_floor
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.estimation.static_evidence import StaticCameras
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.frame_assembler import FrameAssembler
from bodycam_ros.timing.silence import Silence
from bodycam_ros.timing.timeline import Message, Timeline


class SkeletonPipeline:
    """All cameras from registrations to the articulated body.

    Args:
        body: segments, joints and mounts.
        cameras: names of the recording's; those that the body does not carry are ignored.
        settings: of all stages.
        live: whether registrations come while images are taken, see ``FrameAssembler``.
        on_corrected: called with every registration, its stamp corrected by its camera's clock.
        equipment: what the body rides, holds or stands on.
        on_together: called with the share that is done while all frames are solved together.
        static_cameras: static cameras around the body.
        stations: their names.
        imus: camera -> samples of its inertial sensor, as far as they are there; others come by ``add_sample``.

    Attributes:
        body: with the equipment, if any.
        timeline: admits messages of the time that most cameras agree on.
        clocks: of the cameras on the body.
        assembler: makes frames of the body of the messages of single cameras.

    Raises:
        BodyError: the body carries none of the cameras, and none looks at it.
        SettingsError: live, nothing can be solved as a whole.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Collection[str],
        settings: PipelineSettings,
        live: bool = False,
        on_corrected: Callable[[LandmarkMatches], None] = lambda matches: None,
        equipment: Equipment | None = None,
        on_together: Callable[[float], None] = lambda share: None,
        static_cameras: StaticCameras | None = None,
        stations: Collection[str] = (),
        imus: Mapping[str, ImuSamples] | None = None,
    ) -> None:
        if live:
            settings.estimator.check_live()
        self._equipment = equipment and fitted_equipment(equipment, body)
        self.body = body = coupled_body(body, self._equipment)
        self._cameras = tuple(cameras)
        self._settings, self._live, self._on_together = settings, live, on_together
        on_body = [name for name in cameras if name in body.mounts]
        self._static_cameras = static_cameras
        self.timeline = Timeline(settings.assembler.max_wait)
        self.clocks = ClockEstimator(body, on_body, settings.clock, evidence_floor(settings.evidence), live)
        self.assembler = FrameAssembler([*on_body, *stations], settings.assembler, live, self.clocks, on_corrected)
        self._root = body.segment_index[body.root]
        self.inertial = InertialSensors(body, settings.inertial)
        for camera, samples in (imus or {}).items():
            self.inertial.add(camera, samples)
        self._silence, self._is_carried = Silence(), False
        self._counts = SolverCounts()
        self._begin()

    def _begin(self) -> None:
        """Nothing is known of the motion."""
        of = self._settings
        coupling = Coupling(self.body, self._equipment, of.coupling, of.motion) if self._equipment else None
        self._estimator = BodyEstimator(
            self.body,
            self._cameras,
            of.estimator,
            of.motion,
            of.evidence,
            offline=not self._live,
            coupling=coupling,
            contact=of.contact,
            static_cameras=self._static_cameras,
            inertial=self.inertial,
            on_progress=self._on_together,
        )
        self._angle_tracker = JointAngleTracker(self.body)
        self._previous: BodyOutput | None = None
        self._solved_ns = -1

    @property
    def counts(self) -> SolverCounts:
        """Counts of the whole recording, whatever its stamps do."""
        return self._counts + self._estimator.counts

    def add_sample(self, camera: str, stamp_ns: int, reading: tuple[float, ...]) -> list[BodyOutput]:
        """Add one sample of a camera's inertial sensor as it comes; live, outputs while all cameras are silent.

        Args:
            camera: its name.
            stamp_ns: by the sensor's clock [ns].
            reading: angular velocity [rad/s] and acceleration [m/s^2] along the sensor's axes.
        """
        latest_ns = self.inertial.add_sample(camera, stamp_ns, reading)
        if latest_ns is None or not self._live:
            return []
        self._silence.add_sample(latest_ns)
        due_ns = self._silence.due_ns(self._estimator.period_ns)
        return [] if due_ns is None else self._carry(due_ns)

    def add_image(self, stamp_ns: int) -> None:
        """Note that an image was taken, whose registration is still to come; live, it is waited for."""
        self._silence.add_image(stamp_ns)

    def add(self, message: Message) -> list[BodyOutput]:
        """Add a registration, or an image of a static camera; outputs that are ready, by time."""
        outputs, epoch = list[BodyOutput](), self.timeline.epoch
        for each in self.timeline.admit(message):
            if self.timeline.epoch > epoch:
                epoch = self.timeline.epoch
                outputs += self._solve(self.assembler.restart())
                self._silence.restart()
            self._silence.add_message(each.stamp_ns)
            self._is_carried = False
            outputs += self._solve(self.assembler.add(each))
        return outputs

    def poll(self) -> list[BodyOutput]:
        """What is ready because a camera has been silent for long enough by now; live, call it now and then."""
        return self._solve(self.assembler.complete())

    def flush(self) -> list[BodyOutput]:
        """What is left when the recording is over."""
        return self._solve(self.assembler.flush()) + self._outputs(self._estimator.flush())

    def _solve(self, frames: Iterable[BodyFrame]) -> list[BodyOutput]:
        outputs = []
        for frame in frames:
            if frame.stamp_ns <= self._solved_ns:
                outputs += self._outputs(self._estimator.flush())
                self._counts = self.counts
                self._begin()
            self._solved_ns = frame.stamp_ns
            self.inertial.set_clocks(self.clocks.corrections)
            outputs += self._outputs(self._estimator.update(frame))
        return outputs

    def _carry(self, due_ns: float) -> list[BodyOutput]:
        """States without images up to a time [ns], as far as inertial sensors carry the body."""
        period_ns = round(self._estimator.period_ns)
        outputs = [] if self._is_carried else self._solve(self.assembler.flush())
        self._is_carried = True
        due_ns = min(due_ns, self._silence.message_ns + 1e9 * CARRIED_S)
        while self._estimator.has_states and (stamp_ns := self._solved_ns + period_ns) <= due_ns:
            if not self.inertial.carry(self._solved_ns, stamp_ns):
                break
            outputs += self._solve([BodyFrame(stamp_ns, {})])
            self.assembler.skip(stamp_ns)
            self._counts.interpolated += 1
        return outputs

    def _outputs(self, states: Iterable[BodyState]) -> list[BodyOutput]:
        outputs, tracker, root = [], self._angle_tracker, self._root
        for state in states:
            positions = tracker.angles(state.world_T_segment)
            velocities, root_velocity = np.zeros(len(positions)), np.zeros(6)
            if (before := self._previous) is not None:
                passed_s = 1e-9 * (state.stamp_ns - before.state.stamp_ns)
                velocities = tracker.change(before.positions, positions) / passed_s
                before_T_root = inverse(before.state.world_T_segment[root])
                root_velocity = log_se3(before_T_root @ state.world_T_segment[root]) / passed_s
            self._previous = BodyOutput(state, tracker.names, positions, velocities, root_velocity)
            outputs.append(self._previous)
        return outputs
