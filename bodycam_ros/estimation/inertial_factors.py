"""Factors of the cameras' inertial sensors between two states: rotations of segments by their gyroscopes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.factors.inertial_step import InertialStep
from bodycam_ros.estimation.factors.segment_turn import SegmentTurn
from bodycam_ros.geometry import log_so3
from bodycam_ros.inertial.bias_filter import AccelerometerFilter, BiasFilter, turned
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration import Preintegrated
from bodycam_ros.settings import setting
from bodycam_ros.timing.clock_state import ClockState

_DRIFT_S = 2.0  # bias errors last: over this time they add up to their whole, not to a random walk
_LEAST_IMAGES = 20  # registered images without a sample at their time, after which a clock is off
_LATE_NS, _LATE_SHARE = 12_000_000, 0.1  # of samples behind an image, and of such images, which are named
_OTHER_DELAY_S = 0.008  # between its delay and that of the calibration, from which on a sensor is named
_LEVER_M = 0.015  # most that a sensor's place in its camera is off


@dataclass(frozen=True)
class InertialSettings:
    """Inertial sensors in the cameras."""

    enabled: bool = setting(True, reason="use the inertial sensors that the body file has; false ignores them")


class InertialSensors:
    """Inertial sensors of the cameras on a body.

    Args:
        body: its mounts, with calibrations of the sensors.
        settings: whether they are used.
    """

    def __init__(self, body: BodyModel, settings: InertialSettings) -> None:
        mounts = {name: mount for name, mount in body.mounts.items() if mount.imu is not None and settings.enabled}
        self._calibrations = {name: mount.imu for name, mount in mounts.items() if mount.imu is not None}
        self._rows = {name: body.segment_index[mount.segment] for name, mount in mounts.items()}
        self._segment_R_camera = {name: mount.segment_T_camera[:3, :3] for name, mount in mounts.items()}
        self._clocks: Mapping[str, ClockState] = {}
        self._images, self._late = dict.fromkeys(mounts, 0), dict.fromkeys(mounts, 0)
        self.biases = {name: BiasFilter(imu) for name, imu in self._calibrations.items()}
        # Sensors on the root carry the place of the body; without any, those of the next segment that has one.
        rows = sorted(set(self._rows.values()), key=lambda row: int(body.moves[row].sum()))
        self._accelerometers = {
            name: AccelerometerFilter(imu.accelerometer_bias_sigma, imu.accelerometer_noise)
            for name, imu in self._calibrations.items()
            if self._rows[name] == rows[0]
        }
        self._places = {
            name: (mount.segment_T_camera @ np.append(self._calibrations[name].camera_p_imu, 1.0))[:3]
            for name, mount in mounts.items()
        }

    def add(self, camera: str, samples: ImuSamples) -> None:
        """Add samples of a camera's sensor, later than those before; others are ignored."""
        if camera in self.biases:
            self.biases[camera].motion.add(samples)

    def add_sample(self, camera: str, stamp_ns: int, reading: tuple[float, ...]) -> int | None:
        """Add one sample as it comes, see ``SensorMotion``; others are ignored.

        Returns:
            Its stamp in the body's time [ns]; None unless the sensor can carry the body by itself.
        """
        if (filtered := self.biases.get(camera)) is None:
            return None
        filtered.motion.add_sample(stamp_ns, reading)
        if not self._carries(camera) or not filtered.is_confirmed:
            return None
        own_ns, clock = filtered.motion.latest_ns, self._clocks.get(camera)
        return own_ns if clock is None else own_ns - clock.offset_ns(own_ns)

    def set_clocks(self, clocks: Mapping[str, ClockState]) -> None:
        """Use the clocks by which the stamps of frames were corrected; samples are by the cameras' own clocks."""
        self._clocks = clocks

    def _own_ns(self, camera: str, stamp_ns: int) -> int:
        """A stamp by a camera's own clock [ns]."""
        clock = self._clocks.get(camera)
        return stamp_ns if clock is None else stamp_ns + clock.offset_ns(stamp_ns)

    def observe(self, frame: BodyFrame) -> None:
        """Follow biases by the registered cameras of a frame."""
        for name, matches in frame.matches.items():
            if name in self.biases and matches.world_T_camera is not None:
                self._images[name] += 1
                pose, filtered = matches.world_T_camera, self.biases[name]
                stamp_ns = self._own_ns(name, matches.stamp_ns)
                self._late[name] += filtered.motion.latest_ns < stamp_ns - _LATE_NS
                filtered.observe(stamp_ns, pose[:3, :3])
                if name in self._accelerometers:
                    place = pose[:3, :3] @ self._calibrations[name].camera_p_imu + pose[:3, 3]
                    stamp_ns += round(1e9 * filtered.delay)
                    self._accelerometers[name].observe(stamp_ns, pose[:3, :3], place, filtered.motion)

    def factors(self, start_ns: int, end_ns: int, needed: NDArray[np.bool_]) -> list[SegmentTurn | InertialStep]:
        """Motion between two stamps [ns]: rotations of segments (S,) that need one, and all of the root's."""
        factors: list[SegmentTurn | InertialStep] = []
        has_step = False
        for name in self.biases:
            is_needed = bool(needed[self._rows[name]])
            # Where cameras observe the root, one of its sensors is enough to know its velocity.
            takes_step = (is_needed or not has_step) and self._carries(name)
            if self.biases[name].is_wrong or not (is_needed or takes_step):
                continue
            moved = self._moved(name, start_ns, end_ns)
            if moved is None:
                continue
            if is_needed:
                factors.append(self._turn(name, moved))
            if takes_step:
                factors.append(self._step(name, moved, is_needed))
                has_step = True
        return factors

    def carry(self, start_ns: int, end_ns: int) -> bool:
        """Whether sensors on the root cover all between two stamps [ns]."""
        return any(
            self._carries(name) and self._moved(name, start_ns, end_ns) is not None for name in self._accelerometers
        )

    def _moved(self, name: str, start_ns: int, end_ns: int) -> Preintegrated | None:
        """Motion of a sensor between two stamps [ns]."""
        ends = self._own_ns(name, start_ns), self._own_ns(name, end_ns)
        return self.biases[name].moved(*ends)

    def _carries(self, camera: str) -> bool:
        """Whether a camera's sensor can carry the body by itself."""
        accelerometer = self._accelerometers.get(camera)
        return accelerometer is not None and not accelerometer.is_wrong and not self.biases[camera].is_wrong

    def faults(self) -> dict[str, str]:
        """Camera -> why its sensor is left out, or is used less than it could be."""
        faults = {}
        for name, filtered in self.biases.items():
            checked, images = filtered.agreeing + filtered.contradicting, self._images[name]
            accelerometer = self._accelerometers.get(name, filtered)
            if filtered.was_wrong or filtered.is_wrong:
                faults[name] = (
                    f"contradicts the images ({filtered.contradicting} of {checked} times) and is not used; its "
                    "axes, units (rad/s, m/s^2), range and stamps must be as in the range of motion"
                )
            elif accelerometer.was_wrong or accelerometer.is_wrong:
                faults[name] = (
                    f"contradicts the images by its accelerometer ({accelerometer.contradicting} times), which is not "
                    "used; its axes and its unit (m/s^2) must be as in the range of motion"
                )
            elif abs(filtered.delay) > _OTHER_DELAY_S:
                faults[name] = (
                    f"has a delay that differs by {1e3 * filtered.delay:+z.0f} ms from the range of motion, corrected; "
                    "check whether its driver has changed"
                )
            elif not checked and images >= _LEAST_IMAGES and len(filtered.motion):
                faults[name] = (
                    "has no samples at the time of the images and is not used; check that their clocks agree and that "
                    "samples arrive in time"
                )
            elif checked and self._late[name] > max(_LEAST_IMAGES, _LATE_SHARE * images):
                faults[name] = (
                    f"has no samples at {self._late[name]} of {images} images; check that it runs and is not late"
                )
        return faults

    def remarks(self) -> list[str]:
        """A sentence for each sensor that was left out, and why."""
        return [f"camera {name}: its inertial sensor {fault}" for name, fault in self.faults().items()]

    @property
    def in_use(self) -> list[str]:
        """Cameras whose sensor the images have confirmed."""
        return [name for name, filtered in self.biases.items() if filtered.is_confirmed and not filtered.is_wrong]

    def _turn(self, name: str, moved: Preintegrated) -> SegmentTurn:
        imu = self._calibrations[name]
        filtered = self.biases[name]
        segment_R_camera = self._segment_R_camera[name]
        R = turned(moved, filtered.bias)
        of_angle = (imu.gyro_scale_sigma + imu.rotation_sigma) * float(np.linalg.norm(log_so3(R)))
        of_delay = imu.time_offset_sigma * float(np.linalg.norm(moved.change[:3]))
        density = imu.gyro_noise**2 + filtered.sigma**2 * _DRIFT_S
        sigma = float(np.sqrt(density * moved.seconds + of_angle**2 + of_delay**2))
        return SegmentTurn(self._rows[name], segment_R_camera @ R @ segment_R_camera.T, sigma)

    def _step(self, name: str, moved: Preintegrated, with_position: bool) -> InertialStep:
        R = self._segment_R_camera[name]
        filtered = self._accelerometers[name]
        spin_bias = self.biases[name].bias
        imu, (spun, pushed) = self._calibrations[name], np.linalg.norm(moved.change.reshape(2, 3), axis=1)
        lever = min(imu.position_sigma, _LEVER_M)
        return InertialStep(
            segment=self._rows[name],
            place=self._places[name],
            seconds=moved.seconds,
            velocity=R @ (moved.velocity - moved.velocity_by_bias @ filtered.bias),
            position=R @ (moved.position - moved.position_by_bias @ filtered.bias),
            spin_before=R @ (moved.first_rate - spin_bias),
            spin_after=R @ (moved.second_rate - spin_bias),
            density=imu.accelerometer_noise**2 + filtered.sigma**2 * _DRIFT_S,
            sigma=float(np.hypot(lever * spun, imu.time_offset_sigma * pushed)),
            with_position=with_position,
        )
