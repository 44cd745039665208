"""How far a camera turned between two of its images, by its gyroscope."""

import numpy as np

from bodycam_ros.geometry import Array, log_so3
from bodycam_ros.inertial.bias_filter import BiasFilter, turned
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration import SensorMotion

_AROUND_NS = 10_000_000  # half the time that an angular velocity is the mean of: about what rows are read out in


class CameraTurn:
    """Rotation of one camera between stamps of its own clock; its registered images keep the gyroscope's bias.

    Args:
        calibration: of the camera's sensor.
        samples: of the sensor, by its own clock and along its own axes; live there are none yet.
    """

    def __init__(self, calibration: ImuCalibration, samples: ImuSamples | None = None) -> None:
        self._motion = SensorMotion(calibration)
        if samples is not None:
            self._motion.add(samples)
        self._bias = BiasFilter(calibration.gyro_bias_sigma)

    @property
    def is_confirmed(self) -> bool:
        """Whether registered images have confirmed the sensor."""
        return self._bias.is_confirmed

    @property
    def is_wrong(self) -> bool:
        """Whether registered images contradict the sensor."""
        return self._bias.is_wrong

    def add_sample(self, stamp_ns: int, reading: tuple[float, ...]) -> None:
        """As of ``SensorMotion``."""
        self._motion.add_sample(stamp_ns, reading)

    def between(self, start_ns: int, end_ns: int) -> Array | None:
        """(3, 3) rotation later_R_camera from one stamp to a later one [ns].

        None where samples do not cover all of it, or registered images have not confirmed the sensor.
        """
        moved = self._bias.moved(start_ns, end_ns, self._motion) if self.is_confirmed else None
        return None if moved is None else np.asarray(turned(moved, self._bias.bias).T)

    def angular_velocity(self, stamp_ns: int) -> Array | None:
        """(3,) of the camera around a stamp [ns], along its own axes [rad/s].

        Up to the stamp where later samples are yet to come; None as of ``between``.
        """
        for end_ns in (stamp_ns + _AROUND_NS, stamp_ns):
            later_R_camera = self.between(stamp_ns - _AROUND_NS, end_ns)
            if later_R_camera is not None:
                return log_so3(later_R_camera.T) / (1e-9 * (end_ns - stamp_ns + _AROUND_NS))
        return None

    def observe(self, stamp_ns: int, world_T_camera: Array) -> None:
        """Follow the bias by the pose (4, 4) of a registered image, later than the one before."""
        self._bias.observe(stamp_ns, world_T_camera[:3, :3], self._motion)
