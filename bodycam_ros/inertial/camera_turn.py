"""How far a camera turned between two of its images, by its gyroscope."""

import numpy as np

from bodycam_ros.geometry import Array, log_so3
from bodycam_ros.inertial.bias_filter import BiasFilter, turned
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import ImuSamples

_AROUND_NS = 10_000_000  # half the time that an angular velocity is the mean of: about what rows are read out in


class CameraTurn(BiasFilter):
    """Rotation of one camera between stamps of its own clock; its registered images keep the gyroscope's bias.

    Args:
        calibration: of the camera's sensor.
        samples: of the sensor, by its own clock and along its own axes; live there are none yet.
    """

    def __init__(self, calibration: ImuCalibration, samples: ImuSamples | None = None) -> None:
        super().__init__(calibration)
        if samples is not None:
            self.motion.add(samples)

    def between(self, start_ns: int, end_ns: int) -> Array | None:
        """(3, 3) rotation later_R_camera from one stamp to a later one [ns].

        None where samples do not cover all of it, or registered images have not confirmed the sensor.
        """
        moved = self.moved(start_ns, end_ns) if self.is_confirmed else None
        return None if moved is None else np.asarray(turned(moved, self.bias).T)

    def angular_velocity(self, stamp_ns: int) -> Array | None:
        """(3,) of the camera around a stamp [ns], along its own axes [rad/s].

        Up to the stamp where later samples are yet to come; None as of ``between``.
        """
        for end_ns in (stamp_ns + _AROUND_NS, stamp_ns):
            later_R_camera = self.between(stamp_ns - _AROUND_NS, end_ns)
            if later_R_camera is not None:
                return log_so3(later_R_camera.T) / (1e-9 * (end_ns - stamp_ns + _AROUND_NS))
        return None
