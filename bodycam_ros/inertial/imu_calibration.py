"""Where an inertial sensor is in its camera, how late its stamps are, and by how much its readings are off."""

from dataclasses import dataclass, field

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_samples import ImuSamples


@dataclass(frozen=True, eq=False)
class ImuCalibration:
    """Calibration of the inertial sensor of one camera, and its sigmas; as made, of a sensor that nothing is known of.

    Readings are ``scale * true + bias``. The defaults of the sigmas are those of consumer sensors.

    Attributes:
        camera_R_imu: (3, 3) rotation of the sensor's frame in the camera's optical frame.
        camera_p_imu: (3,) place of the sensor in the camera's optical frame [m].
        time_offset: sensor's stamp minus the camera's stamp of the same moment [s].
        gyro_bias: (3,) [rad/s].
        gyro_scale: (3,) along the sensor's axes.
        accelerometer_bias: (3,) [m/s^2].
        accelerometer_scale: (3,) along the sensor's axes.
        rotation_sigma: of ``camera_R_imu`` [rad].
        position_sigma: of ``camera_p_imu`` [m].
        time_offset_sigma: [s].
        gyro_bias_sigma: [rad/s].
        gyro_scale_sigma: of the scale.
        accelerometer_bias_sigma: [m/s^2].
        gyro_noise: spectral density of the angular velocity [rad/s/sqrt(Hz)].
        accelerometer_noise: spectral density of the acceleration [m/s^2/sqrt(Hz)].
    """

    camera_R_imu: Array = field(default_factory=lambda: np.eye(3))
    camera_p_imu: Array = field(default_factory=lambda: np.zeros(3))
    time_offset: float = 0.0
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    gyro_scale: Array = field(default_factory=lambda: np.ones(3))
    accelerometer_bias: Array = field(default_factory=lambda: np.zeros(3))
    accelerometer_scale: Array = field(default_factory=lambda: np.ones(3))
    rotation_sigma: float = 0.05
    position_sigma: float = 0.02
    time_offset_sigma: float = 0.005
    gyro_bias_sigma: float = 0.02
    gyro_scale_sigma: float = 0.005
    accelerometer_bias_sigma: float = 0.1
    gyro_noise: float = 2.5e-4
    accelerometer_noise: float = 2e-3

    def correct(self, samples: ImuSamples) -> ImuSamples:
        """Samples by the camera's clock, along the camera's axes, without scale and bias."""
        w = (samples.angular_velocity - self.gyro_bias) / self.gyro_scale
        a = (samples.acceleration - self.accelerometer_bias) / self.accelerometer_scale
        stamps_ns = samples.stamps_ns - round(1e9 * self.time_offset)
        return ImuSamples(stamps_ns, w @ self.camera_R_imu.T, a @ self.camera_R_imu.T)
