"""How a camera moves, from where it was registered lately."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import inverse, log_se3, log_so3
from bodycam_ros.registration.readout_time import ReadoutTime, ShutterSettings
from bodycam_ros.registration.rolling_shutter import ImageMotion
from bodycam_ros.tracking.track_frame import TrackFrame

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
