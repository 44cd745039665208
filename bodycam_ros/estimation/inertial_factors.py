"""Factors of the cameras' inertial sensors between two states: rotations of segments by their gyroscopes."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.motion_model import SegmentTurn
from bodycam_ros.geometry import log_so3
from bodycam_ros.inertial.bias_filter import BiasFilter, turned
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.preintegration import MotionSums
from bodycam_ros.settings import setting
from bodycam_ros.timing.clock_state import ClockState

_DRIFT_S = 2.0  # bias errors last: over this time they add up to their whole, not to a random walk
_LEAST_RAD = 2e-5  # sigma of a rotation


@dataclass(frozen=True)
class InertialSettings:
    """Inertial sensors in the cameras."""

    enabled: bool = setting(True, reason="use the inertial sensors that the body file knows; false ignores them")


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
        self._sums = {name: MotionSums() for name in mounts}
        self._clocks: Mapping[str, ClockState] = {}
        self.biases = {name: BiasFilter(imu.gyro_bias_sigma) for name, imu in self._calibrations.items()}

    def add(self, camera: str, samples: ImuSamples) -> None:
        """Add samples of a camera's sensor, later than those before; others are ignored."""
        if camera in self._sums:
            self._sums[camera].add(self._calibrations[camera].correct(samples))

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
            if name in self._sums and matches.world_T_camera is not None:
                stamp_ns = self._own_ns(name, matches.stamp_ns)
                self.biases[name].observe(stamp_ns, matches.world_T_camera[:3, :3], self._sums[name])

    def turns(self, start_ns: int, end_ns: int, needed: NDArray[np.bool_]) -> list[SegmentTurn]:
        """Rotations of segments between two stamps [ns], of the segments (S,) that need one."""
        turns = []
        for name, sums in self._sums.items():
            row, imu, filtered = self._rows[name], self._calibrations[name], self.biases[name]
            ends = self._own_ns(name, start_ns), self._own_ns(name, end_ns)
            moved = sums.between(*ends) if needed[row] else None
            if moved is None:
                continue
            R, segment_R_camera = turned(moved, filtered.bias), self._segment_R_camera[name]
            angle = float(np.linalg.norm(log_so3(R)))
            sigma = np.sqrt(
                imu.gyro_noise**2 * moved.seconds
                + filtered.sigma**2 * _DRIFT_S * moved.seconds
                + ((imu.gyro_scale_sigma + imu.rotation_sigma) * angle) ** 2
                + _LEAST_RAD**2
            )
            turns.append(SegmentTurn(row, segment_R_camera @ R @ segment_R_camera.T, float(sigma)))
        return turns
