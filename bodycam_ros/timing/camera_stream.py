"""One camera's messages on their way to frames of the body.

A camera that shares its stamps with others gives its messages as they are. A free-running one gives its pose at any
stamp, on its path between the image before and the image after; without one of them close by there is none, and the
solver predicts.
"""

import time
from collections import deque
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import path_points
from bodycam_ros.timing.clock_evidence import MAX_GAP_S
from bodycam_ros.timing.timeline import Message

_SAME_FRAME = 0.49  # of the time between two images of a camera: within it they are of the same state
_INTERVALS = 9  # intervals of whose median a camera's rate is made: a lost image now and then does not matter
_KEPT_NS = round(2e9 * MAX_GAP_S)  # of images before the latest frame, for the path of a free-running camera


class CameraStream:
    """Messages of one camera, which is waited for from now on.

    Args:
        tolerance_ns: by which stamps of one frame differ [ns].

    Attributes:
        is_free: whether it takes its images at times of its own.
        messages: those that wait for their frames, in the body's time; of a free-running camera older ones too.
        latest_ns: latest stamp in the body's time [ns]; -1 before the first.
        within_ns: how far after a frame's stamp the camera's image is of the same state [ns].
        came_s: when the latest message came, on the steady clock.
    """

    def __init__(self, tolerance_ns: int) -> None:
        self.is_free = False
        self.messages = deque[Message]()
        self.latest_ns = -1
        self.within_ns = self._tolerance_ns = tolerance_ns
        self.came_s = time.monotonic()
        self._intervals_ns: deque[int] = deque(maxlen=_INTERVALS)
        self._previous: tuple[int, int] | None = None

    def set_free(self, is_free: bool, assembled_ns: int) -> None:
        """Set whether it runs freely, where frames up to a stamp [ns] are assembled."""
        self.is_free = is_free
        if not is_free:
            self._drop(assembled_ns)

    def _drop(self, until_ns: int) -> None:
        while self.messages and self.messages[0].stamp_ns <= until_ns:
            self.messages.popleft()

    def add(self, message: Message, is_late: bool = False) -> None:
        """Add the next message, its stamp in the body's time; late ones are for interpolation alone."""
        if self.latest_ns >= 0:
            self._intervals_ns.append(message.stamp_ns - self.latest_ns)
            self.within_ns = round(min(self._tolerance_ns, _SAME_FRAME * median(self._intervals_ns)))
        self.latest_ns = message.stamp_ns
        if self.messages and message.stamp_ns <= self.messages[-1].stamp_ns:
            # Its clock was corrected backwards.
            self.messages.clear()
            self._previous = None
        if self.is_free or not is_late:
            self.messages.append(message)

    def has_passed(self, stamp_ns: int, common_ns: int | None) -> bool:
        """Whether later messages change nothing of a frame, see ``take``."""
        if not self.is_free:
            return bool(self.messages) or self.latest_ns > stamp_ns + self.within_ns
        wanted_ns = stamp_ns + self.within_ns if common_ns is None else common_ns
        # The image after the next one gives the twist at the next.
        is_enclosed = len(self.messages) > 1 and self.messages[-2].stamp_ns >= wanted_ns
        return is_enclosed or any(image.stamp_ns == common_ns for image in self.messages)

    def take(self, stamp_ns: int, common_ns: int | None) -> Message | None:
        """What the camera has of a frame.

        Args:
            stamp_ns: of the frame [ns].
            common_ns: stamp that free-running cameras are interpolated to [ns]; None: they take no part.
        """
        if self.is_free:
            self._drop(stamp_ns - _KEPT_NS)
            return None if common_ns is None else self.interpolate(common_ns)
        is_there = self.messages and self.messages[0].stamp_ns <= stamp_ns + self.within_ns
        return self.messages.popleft() if is_there else None

    def interpolate(self, stamp_ns: int) -> LandmarkMatches | None:
        """A free-running camera at a stamp [ns], later than the one before; None without an image near it."""
        images = [each for each in self.messages if isinstance(each, LandmarkMatches)]
        nearest = min(images, key=lambda image: abs(image.stamp_ns - stamp_ns), default=None)
        if nearest is None or 1e-9 * abs(stamp_ns - nearest.stamp_ns) > MAX_GAP_S / 2.0:
            return None
        if nearest.stamp_ns == stamp_ns:
            return self._restamped(nearest, stamp_ns)
        if nearest.world_T_camera is not None:
            known = [(image.stamp_ns, image.world_T_camera) for image in images if image.world_T_camera is not None]
            own_ns, poses = map(np.array, zip(*known, strict=True))
            point = path_points(own_ns, poses, np.array([stamp_ns]), MAX_GAP_S)
            if len(point.rows):
                covariance = nearest.pose_covariance + np.diag(point.variances[0])
                return self._restamped(nearest, stamp_ns, world_T_camera=point.poses[0], pose_covariance=covariance)
        return self._restamped(nearest, stamp_ns, world_T_camera=None)

    def _restamped(self, image: LandmarkMatches, stamp_ns: int, **changes: Any) -> LandmarkMatches:
        """An image without its landmarks at another stamp, with the rotation since the one before, if known."""
        previous, self._previous = self._previous, (stamp_ns, image.stamp_ns)
        image = image.bare() if stamp_ns != image.stamp_ns else image
        if previous is None or previous[1] != image.previous_stamp_ns:
            return replace(image, stamp_ns=stamp_ns, previous_stamp_ns=0, rotation_inliers=0, **changes)
        stretch = (stamp_ns - previous[0]) / (image.stamp_ns - image.previous_stamp_ns)
        rotation = image.current_R_previous
        if stretch != 1.0:
            rotation = exp_so3(stretch * log_so3(rotation))
        return replace(image, stamp_ns=stamp_ns, previous_stamp_ns=previous[0], current_R_previous=rotation, **changes)
