"""How a camera moves, from where it was registered lately.

A row ``s`` in [-0.5, 0.5] from the first to the last is exposed ``s * readout_time`` after the middle one. By then a
camera of twist ``xi`` sees a point where ``exp(-s * readout_time * xi)`` takes it. The twist follows from the poses
of the images before, which the camera's own acceleration bends a little; the rows of the image itself say how much.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import exp_so3, inverse, log_se3, log_so3
from bodycam_ros.registration.readout_time import ReadoutTime, ShutterSettings
from bodycam_ros.tracking.track_frame import TrackFrame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ImageMotion:
    """How a camera moves while an image is taken, as far as the images before tell.

    Its twist at a pose is ``gain * log(inverse(world_T_previous) @ pose) + twist``, give or take ``sigmas``.

    Attributes:
        readout_time: from the exposure of the first row to that of the last [s]; negative from the bottom up.
        readout_sigma: its standard deviation [s]; zero if it is given.
        world_T_previous: (4, 4) pose of an image before.
        gain: what a step since then adds to the twist [1/s].
        twist: (6,) the rest of the twist, rotation [rad/s] then translation [m/s] in camera axes.
        sigmas: (6,) by how much the true twist may differ [rad/s, m/s].
        turning: (3,) angular velocity without a pose, from the tracks or from before [rad/s].
    """

    readout_time: float
    readout_sigma: float
    world_T_previous: Array
    gain: float
    twist: Array
    sigmas: Array
    turning: Array

    @property
    def sweeps(self) -> bool:
        """Whether the rows are, or may be, read out one after the other."""
        return self.readout_time != 0.0 or self.readout_sigma != 0.0

    @property
    def as_vector(self) -> Array:
        """As ``pose_kernels`` take it (15,): read-out time and its sigma, gain, twist, sigmas."""
        return np.concatenate([[self.readout_time, self.readout_sigma, self.gain], self.twist, self.sigmas])

    def twist_at(self, world_T_camera: Array) -> Array:
        """(6,) [rad/s, m/s]."""
        step: Array = log_se3(inverse(self.world_T_previous) @ world_T_camera)
        return self.gain * step + self.twist


def row_shares(camera: CameraModel, pixels: NDArray[np.floating]) -> Array:
    """Where in the read-out the rows of pixels (N, 2) are: -0.5 the first row, 0.5 the last."""
    shares: Array = np.asarray(pixels, np.float64)[:, 1] / (camera.height - 1) - 0.5
    return shares


def seen_later(points_camera: Array, twist: Array, times_s: Array) -> Array:
    """Points (N, 3) of the camera's frame where a camera of some twist (6,) sees them at times (N,) [s] from now.

    The exponential's series up to its second term: 10 rad/s over 6 ms leave 0.01 px.
    """
    moved = times_s[:, None] * (np.cross(points_camera, twist[:3]) - twist[3:])
    curved: Array = points_camera + moved + 0.5 * times_s[:, None] * np.cross(moved, twist[:3])
    return curved


def steady_pixels(
    camera: CameraModel, pixels: NDArray[np.floating], angular_velocity: Array, readout_time: float
) -> NDArray[np.float64]:
    """Where pixels (M, 2) would be if all rows were exposed with the middle one, by the camera's turning alone.

    For gates and for a search without a pose: what moves by translation is some tenths of a pixel.

    Args:
        camera: the model.
        pixels: (M, 2) as the image shows them.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_time: of the camera [s].
    """
    given = np.asarray(pixels, np.float64)
    if readout_time == 0.0 or not len(given):
        return given
    bearings, in_view = camera.unproject(given)
    turns = exp_so3(readout_time * row_shares(camera, given)[:, None] * angular_velocity)
    steady, valid = camera.project((turns @ bearings[:, :, None])[:, :, 0])
    return np.where((in_view & valid)[:, None], steady, given)


def by_pose(pixel_by_point: Array, points_camera: Array) -> Array:
    """Derivatives (N, 2, 6) of pixels by the camera's tangent (w, v): the point moves by ``hat(p) w - v``."""
    jacobian = np.empty((len(points_camera), 2, 6))
    x, y, z = points_camera.T[:, :, None]
    by_x, by_y, by_z = np.moveaxis(pixel_by_point, 2, 0)
    jacobian[:, :, 0] = by_y * z - by_z * y
    jacobian[:, :, 1] = by_z * x - by_x * z
    jacobian[:, :, 2] = by_x * y - by_y * x
    np.negative(pixel_by_point, out=jacobian[:, :, 3:])
    return jacobian


_UNKNOWN = 4.0
"""Times wider sigmas where the motion has no past to follow from."""

_BOTH_SIDES = 0.2
"""Times narrower sigmas where the images before and after tell the motion."""

_UNEVEN = 0.4
"""Of the change from step to step: so much of it may come at once."""


@dataclass(frozen=True)
class RegisteredView:
    """An image whose pose is known.

    Attributes:
        stamp_ns: [ns].
        world_T_camera: (4, 4).
        points_world: (N, 3) its landmarks [m].
        pixels: (N, 2) where the image shows them.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    points_world: NDArray[np.floating]
    pixels: NDArray[np.floating]


class RecentPath:
    """The latest views of one camera, as long as none is missing between them.

    Args:
        settings: how much a twist changes from image to image.
    """

    def __init__(self, settings: ShutterSettings) -> None:
        self._sigmas = np.repeat([settings.turn_sigma, settings.speed_sigma], 3)
        self._views: deque[RegisteredView] = deque(maxlen=3)

    def add(self, view: RegisteredView, previous_stamp_ns: int) -> None:
        """A registered image, and the stamp of the one before it, registered or not."""
        if self._views and self._views[-1].stamp_ns != previous_stamp_ns:
            self._views.clear()
        self._views.append(view)

    def motion(
        self, stamp_ns: int, previous_stamp_ns: int, tracks: TrackFrame | None, readout: ReadoutTime
    ) -> ImageMotion | None:
        """The motion while a new frame is taken; None if nothing is known of it, or all rows are exposed together.

        From the mean twists of the last two steps, if equally long, the twist at the end of the second is 3/2 of the
        second less 1/2 of the first; with one step alone it is taken for the mean; with none the tracks say how the
        camera turns.
        """
        seconds = readout.in_use
        if seconds == 0.0:
            return None
        dt_s = 1e-9 * (stamp_ns - previous_stamp_ns)
        views = list(self._views) if self._views and self._views[-1].stamp_ns == previous_stamp_ns else []
        before = _mean_twist(views[-2], views[-1]) if len(views) > 1 else None
        if tracks is not None and tracks.rotation_inliers:
            turning = log_so3(tracks.current_R_previous.T) / dt_s
        elif before is not None:
            turning = before[:3]
        else:
            return None
        if before is not None:
            bend = dt_s / (dt_s + 1e-9 * (views[-1].stamp_ns - views[-2].stamp_ns))
            gain, rest = (1.0 + bend) / dt_s, -bend * before
            return ImageMotion(seconds, 0.0, views[-1].world_T_camera, gain, rest, self._sigmas, turning)
        wide = _UNKNOWN * self._sigmas
        if views:
            return ImageMotion(seconds, 0.0, views[-1].world_T_camera, 1.0 / dt_s, np.zeros(6), wide, turning)
        return ImageMotion(seconds, 0.0, np.eye(4), 0.0, np.concatenate([turning, np.zeros(3)]), wide, turning)

    def between(self, readout: ReadoutTime) -> tuple[RegisteredView, ImageMotion] | None:
        """The view before the latest, and its motion as the views on both sides tell; None while there are not three.

        It is free of the view's own error, which would else bias a read-out time towards zero.
        """
        if len(self._views) < 3:
            return None
        before, view, after = self._views
        first_s, second_s = 1e-9 * (view.stamp_ns - before.stamp_ns), 1e-9 * (after.stamp_ns - view.stamp_ns)
        # The parabola through all three; the view's own error cancels where the steps are equally long.
        first, second = _mean_twist(before, view), _mean_twist(view, after)
        twist = (second_s * first + first_s * second) / (first_s + second_s)
        # What changes fast does not change evenly: a foot that lands stops between two images.
        sigmas = _BOTH_SIDES * self._sigmas + _UNEVEN * np.abs(second - first)
        return view, ImageMotion(readout.seconds, readout.sigma, np.eye(4), 0.0, twist, sigmas, twist[:3])


def _mean_twist(first: RegisteredView, second: RegisteredView) -> NDArray[np.float64]:
    step: NDArray[np.float64] = log_se3(inverse(first.world_T_camera) @ second.world_T_camera)
    return step / (1e-9 * (second.stamp_ns - first.stamp_ns))
