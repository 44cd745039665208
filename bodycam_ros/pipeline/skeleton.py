"""The stages wired together once, for the offline replay and for the live nodes alike.

    image --FeatureTracker--> TrackFrame --Registrar--> LandmarkMatches --Arrivals, BodyEstimator--> BodyOutput

What happens to one camera is in ``pipeline/camera_front.py``; ``SkeletonPipeline`` is what happens to all cameras'
registrations.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

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
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.arrivals import Arrivals
from bodycam_ros.timing.clock_estimator import ClockEstimator, KnownClocks
from bodycam_ros.timing.timeline import Message


class SkeletonPipeline:
    """All cameras from registrations to the articulated body.

    Args:
        body: segments, joints and mounts.
        cameras: names of the recording's; those that the body does not carry are ignored.
        settings: of all stages.
        live: whether registrations come while images are taken, see ``Arrivals``.
        on_corrected: called with every registration, its stamp corrected by its camera's clock.
        equipment: what the body rides, holds or stands on.
        on_together: called with the share that is done while all frames are solved together.
        static_cameras: static cameras around the body.
        stations: their names.
        imus: camera -> samples of its inertial sensor, as far as they are there; others come by ``add_sample``.
        known_clocks: by a first pass over the recording; None to estimate them.
        known_rotations: of the joints, likewise; see ``PosePrior``.

    Attributes:
        body: with the equipment, if any.
        clocks: of the cameras on the body.
        arrivals: makes frames of the body of the messages of single cameras.

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
        known_clocks: KnownClocks | None = None,
        known_rotations: Mapping[str, Sequence[Sequence[float]]] | None = None,
    ) -> None:
        if live:
            settings.estimator.check_live()
        self._equipment = equipment and fitted_equipment(equipment, body)
        self.body = body = coupled_body(body, self._equipment)
        self._cameras = tuple(cameras)
        self._settings = settings
        self._live = live
        self._on_together = on_together
        on_body = [name for name in cameras if name in body.mounts]
        self._static_cameras = static_cameras
        self.clocks = ClockEstimator(
            body, on_body, settings.clock, evidence_floor(settings.evidence), live, known_clocks
        )
        self.arrivals = Arrivals([*on_body, *stations], settings.assembler, live, self.clocks, on_corrected)
        self.inertial = InertialSensors(body, settings.inertial)
        for camera, samples in (imus or {}).items():
            self.inertial.add(camera, samples)
        self._known_rotations = known_rotations
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
            known_rotations=self._known_rotations,
            on_progress=self._on_together,
        )
        self._angle_tracker = JointAngleTracker(self.body)
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
        due_ns = self.arrivals.add_sample(latest_ns, self._estimator.period_ns)
        return [] if due_ns is None else self._carry(due_ns)

    def add_image(self, stamp_ns: int) -> None:
        """Note that an image was taken, whose registration is still to come; live, it is waited for."""
        self.arrivals.add_image(stamp_ns)

    def add(self, message: Message) -> list[BodyOutput]:
        """Add a registration, or an image of a static camera; outputs that are ready, by time."""
        return self._solve(self.arrivals.add(message))

    def poll(self) -> list[BodyOutput]:
        """What is ready because a camera has been silent for long enough by now; live, call it now and then."""
        return self._solve(self.arrivals.complete())

    def flush(self) -> list[BodyOutput]:
        """What is left when the recording is over."""
        return self._solve(self.arrivals.flush()) + self._outputs(self._estimator.flush())

    def _solve(self, frames: Iterable[BodyFrame]) -> list[BodyOutput]:
        outputs = []
        for frame in frames:
            if frame.is_earlier:
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
        outputs = self._solve(self.arrivals.flush())
        due_ns = min(due_ns, self.arrivals.latest_message_ns + 1e9 * CARRIED_S)
        while self._estimator.has_states and (stamp_ns := self._solved_ns + period_ns) <= due_ns:
            if not self.inertial.carry(self._solved_ns, stamp_ns):
                break
            outputs += self._solve([self.arrivals.frame_without_images(stamp_ns)])
            self._counts.interpolated += 1
        return outputs

    def _outputs(self, states: Iterable[BodyState]) -> list[BodyOutput]:
        outputs, tracker = [], self._angle_tracker
        for state in states:
            positions = tracker.angles(state.world_T_segment)
            velocities = tracker.velocities(state.world_T_segment, state.twists)
            outputs.append(BodyOutput(state, tracker.names, positions, velocities))
        return outputs
