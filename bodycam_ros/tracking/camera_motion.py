"""The motion of one camera: its pose between registered images, and its twist while the rows of an image are read out.

The model is a constant twist between images, given the time that passed. A measured rotation (A eq. 2, or a
gyroscope's) replaces the predicted one.

A row ``s`` in [-0.5, 0.5] from the first to the last is exposed ``s * readout_time`` after the middle one. By then a
camera of twist ``xi`` sees a point where ``exp(-s * readout_time * xi)`` takes it. The twist follows from the poses
of the images before, up to the camera's own acceleration; the rows of the image itself correct it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, log_so3, nearest_rotation, rigid

LONGEST_NS: Final = 500_000_000
"""A prediction further ahead stays where it is after this time."""

TWIST_SIGMAS: Final = np.repeat([0.5, 0.15], 3)
"""[rad/s, m/s] difference of the twist in an image from the one that the images before predict."""

_KEPT = 3  # poses
_GYROSCOPE_SIGMA = 0.05  # [rad/s] of a twist that a gyroscope measured: its change while rows are read out
_UNKNOWN = 4.0  # times wider sigmas where only one image precedes
_BOTH_SIDES = 0.2  # times narrower sigmas between two images
_UNEVEN = 0.4  # share of the change between two steps that may come at once, such as of a foot that lands


def camera_velocity(world_T_earlier: Array, world_T_camera: Array, passed_ns: int) -> Array:
    """(6,) twist in camera axes [rad/s, m/s] that moves a camera from one pose to another in the time passed [ns]."""
    return np.asarray(log_se3(inverse(world_T_earlier) @ world_T_camera) / (1e-9 * passed_ns))


@dataclass(frozen=True)
class ImageMotion:
    """The motion of a camera while the rows of an image are read out, as the images before predict it.

    The twist at a pose is ``gain * log(inverse(world_T_previous) @ pose) + twist``, up to ``sigmas``.

    Attributes:
        readout_time: from the exposure of the first row to that of the last [s]; negative from the bottom up.
        readout_sigma: its standard deviation [s]; zero if it is given.
        world_T_previous: (4, 4) pose of the image before.
        gain: (6,) what a step since then adds to the twist [1/s].
        twist: (6,) the constant part of the twist, rotation [rad/s] then translation [m/s] in camera axes.
        sigmas: (6,) standard deviation of the true twist from this [rad/s, m/s].
        turning: (3,) angular velocity without a pose, from the tracks or the images before [rad/s].
    """

    readout_time: float
    readout_sigma: float
    world_T_previous: Array
    gain: Array
    twist: Array
    sigmas: Array
    turning: Array

    @property
    def is_rolling(self) -> bool:
        """Whether the rows are, or may be, read out one after the other."""
        return self.readout_time != 0.0 or self.readout_sigma != 0.0

    @property
    def as_vector(self) -> Array:
        """As ``pose_kernels`` take it (20,): read-out time and its sigma, gain, twist, sigmas."""
        return np.concatenate(((self.readout_time, self.readout_sigma), self.gain, self.twist, self.sigmas))

    def twist_of(self, world_T_camera: Array) -> Array:
        """(6,) twist at a pose (4, 4) [rad/s, m/s]."""
        step: Array = log_se3(inverse(self.world_T_previous) @ world_T_camera)
        return self.gain * step + self.twist


@dataclass(frozen=True)
class CameraMotion:
    """Predicts the poses of one camera from its latest registered images.

    Attributes:
        world_T_camera: (4, 4) the latest pose, registered or predicted; None if it is unknown.
        poses: stamps [ns] and poses (4, 4) of the latest consecutive registered images, three at most.
    """

    world_T_camera: Array | None = None
    poses: tuple[tuple[int, Array], ...] = ()

    def with_pose(self, stamp_ns: int, world_T_camera: Array, previous_stamp_ns: int) -> "CameraMotion":
        """Return the motion after a registered image.

        ``previous_stamp_ns`` is that of the image before it, registered or not [ns].
        """
        follows = bool(self.poses) and self.poses[-1][0] == previous_stamp_ns
        before = self.poses[1 - _KEPT :] if follows else ()
        return CameraMotion(world_T_camera, (*before, (stamp_ns, world_T_camera)))

    def with_unregistered(self, world_T_camera: Array | None) -> "CameraMotion":
        """Return the motion after an unregistered image, with its predicted pose; None: the camera is lost."""
        if world_T_camera is not None:
            # Or rounding doubles with every image.
            world_T_camera = rigid(nearest_rotation(world_T_camera[:3, :3]), world_T_camera[:3, 3])
        return CameraMotion(world_T_camera, self.poses)

    def predict(self, passed_ns: int, later_R_camera: Array | None = None) -> Array | None:
        """The pose (4, 4) some time after the latest [ns]; a measured rotation since (3, 3) is used (A eq. 2)."""
        if self.world_T_camera is None:
            return None
        velocity = self._latest_twist if len(self.poses) > 1 else np.zeros(6)
        camera_T_later = exp_se3(1e-9 * min(passed_ns, LONGEST_NS) * velocity)
        if later_R_camera is not None:
            camera_T_later = rigid(later_R_camera.T, camera_T_later[:3, 3])
        predicted: Array = self.world_T_camera @ camera_T_later
        return predicted

    def in_image(
        self,
        stamp_ns: int,
        previous_stamp_ns: int,
        later_R_camera: Array | None,
        readout_time: float,
        angular_velocity: Array | None = None,
    ) -> ImageMotion | None:
        """The motion while the next image is read out; None if it is unknown, or all rows are exposed together.

        From the mean twists of the last two steps, if equally long, the twist at the end of the second is 3/2 of the
        second less 1/2 of the first; one step alone gives its mean; without any the measured rotation gives the
        turning. A gyroscope's angular velocity (3,) [rad/s] takes the place of all of these.
        """
        if readout_time == 0.0:
            return None
        dt_s = 1e-9 * (stamp_ns - previous_stamp_ns)
        poses = self.poses if self.poses and self.poses[-1][0] == previous_stamp_ns else ()
        before = self._latest_twist if len(poses) > 1 else None
        turning = np.zeros(3) if before is None else before[:3]
        if later_R_camera is not None:
            turning = log_so3(later_R_camera.T) / dt_s
        world_T_previous = poses[-1][1] if poses else np.eye(4)
        gain = np.zeros(6)
        rest = np.zeros(6)
        sigmas = _UNKNOWN * TWIST_SIGMAS
        if before is not None:
            bend = dt_s / (dt_s + 1e-9 * (poses[-1][0] - poses[-2][0]))
            gain = np.full(6, (1.0 + bend) / dt_s)
            rest = -bend * before
            sigmas = TWIST_SIGMAS.copy()
        elif poses:
            gain = np.full(6, 1.0 / dt_s)
        elif later_R_camera is None and angular_velocity is None:
            return None
        else:
            rest[:3] = turning
        if angular_velocity is not None:
            turning = rest[:3] = angular_velocity
            gain[:3], sigmas[:3] = 0.0, _GYROSCOPE_SIGMA
        return ImageMotion(readout_time, 0.0, world_T_previous, gain, rest, sigmas, turning)

    def in_middle_image(self, readout_time: float, readout_sigma: float) -> ImageMotion | None:
        """The motion in the image before the latest, from both neighbours; None without three images in a row.

        It is free of the image's own error, which would bias a read-out time towards zero.
        """
        if len(self.poses) < 3:
            return None
        before_ns, middle_ns, after_ns = (stamp_ns for stamp_ns, _ in self.poses)
        first_s, second_s = 1e-9 * (middle_ns - before_ns), 1e-9 * (after_ns - middle_ns)
        # The parabola through all three; the image's own error cancels where the steps are equally long.
        first, second = self._mean_twist(-2), self._latest_twist
        twist = (second_s * first + first_s * second) / (first_s + second_s)
        sigmas = _BOTH_SIDES * TWIST_SIGMAS + _UNEVEN * np.abs(second - first)
        return ImageMotion(readout_time, readout_sigma, np.eye(4), np.zeros(6), twist, sigmas, twist[:3])

    @cached_property
    def _latest_twist(self) -> Array:
        """(6,) twist in camera axes between the latest two images [rad/s, m/s]."""
        return self._mean_twist(-1)

    def _mean_twist(self, step: int) -> Array:
        """(6,) twist in camera axes between two consecutive images [rad/s, m/s]: -1 is the latest step."""
        (earlier_ns, earlier), (later_ns, later) = self.poses[step - 1], self.poses[step]
        return camera_velocity(earlier, later, later_ns - earlier_ns)
