"""From images of free-running cameras to common stamps of the body.

Cameras that share their stamps pass as they are, and their stamps are the common ones. The others are interpolated to
them; where no cameras share, the common stamps are equally spaced.

The pose of an interpolated camera is that of its path between the image before and the image after; without one of
them close by there is none, and the solver predicts.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import CameraPath
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_evidence import MAX_GAP_S
from bodycam_ros.timing.clock_state import ClockSettings

_SAME_NS = 1_000_000  # stamps of one trigger differ by less
_MISSING_NS = 1_000_000_000  # after so long without cameras that share their stamps, common stamps are spaced equally
_LONGEST_GAP_NS = 60_000_000_000  # no common stamps are made for a gap longer than this
_KEPT_NS = 1_000_000_000  # of images: live, common stamps may be known only later
_MOST_STAMPS = 2000  # common stamps that a camera has no image near


class TimeSynchronizer:
    """Brings all cameras of a body to common stamps.

    Args:
        body: calibrated.
        cameras: names; those of the body are used.
        settings: of clocks.
        floor: (6, 6) covariance that is added to every registration's.
        live: whether images come while they are taken.
        on_corrected: called with every image, its stamp corrected.

    Attributes:
        clocks: of the cameras.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Iterable[str],
        settings: ClockSettings,
        floor: Array,
        live: bool,
        on_corrected: Callable[[LandmarkMatches], None] = lambda matches: None,
    ) -> None:
        names = [name for name in cameras if name in body.mounts]
        self._body, self._on_corrected = body, on_corrected
        self.clocks = ClockEstimator(body, names, settings, floor, live)
        self._interpolators = {name: CameraInterpolator() for name in names}
        self._last_ns = self._shared_ns = -1

    def join(self, camera: str) -> None:
        """Use one more camera."""
        if camera in self._body.mounts:
            self.clocks.join(camera)
            self._interpolators.setdefault(camera, CameraInterpolator())

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """Add one camera's image; images at common stamps that are ready."""
        return self._interpolate(self.clocks.add(matches))

    def flush(self) -> list[LandmarkMatches]:
        """What is left when the recording is over."""
        left = self._interpolate(self.clocks.flush())
        for interpolator in self._interpolators.values():
            left += interpolator.flush()
        return sorted(left, key=lambda matches: (matches.stamp_ns, matches.camera))

    def restart(self) -> None:
        """Begin a new epoch, after ``flush``: clocks are kept."""
        self.clocks.restart()
        self._interpolators = {name: CameraInterpolator() for name in self._interpolators}
        self._last_ns = self._shared_ns = -1

    def _interpolate(self, corrected: Iterable[LandmarkMatches]) -> list[LandmarkMatches]:
        ready = []
        sharing = self.clocks.sharing
        for matches in corrected:
            self._on_corrected(matches)
            for stamp_ns in self._new_stamps(matches.stamp_ns, matches.camera in sharing):
                for camera, interpolator in self._interpolators.items():
                    if camera not in sharing:
                        ready += interpolator.add_stamp(stamp_ns)
            ready += [matches] if matches.camera in sharing else self._interpolators[matches.camera].add(matches)
        return ready

    def _new_stamps(self, stamp_ns: int, shares: bool) -> list[int]:
        """New common stamps up to that of an image."""
        if shares:
            self._shared_ns = max(self._shared_ns, stamp_ns)
            if stamp_ns <= self._last_ns + _SAME_NS:
                return []
            self._last_ns = stamp_ns
            return [stamp_ns]
        shared = self.clocks.shared
        period_ns = shared.period_ns if shared else 0
        if not period_ns or (self.clocks.sharing and not 0 <= self._shared_ns < stamp_ns - _MISSING_NS):
            return []
        if self._last_ns < 0 or stamp_ns - self._last_ns > _LONGEST_GAP_NS:
            new = [stamp_ns // period_ns * period_ns]
        else:
            new = [*range(self._last_ns + period_ns, stamp_ns + 1, period_ns)]
        self._last_ns = new[-1] if new else self._last_ns
        return new


class CameraInterpolator:
    """Interpolates one camera to common stamps."""

    def __init__(self) -> None:
        self._images: deque[LandmarkMatches] = deque()
        self._stamps: deque[int] = deque(maxlen=_MOST_STAMPS)
        self._previous: tuple[int, int] | None = None

    def add_stamp(self, stamp_ns: int) -> list[LandmarkMatches]:
        """One more common stamp, later than those before; images that are ready."""
        if not self._stamps or stamp_ns > self._stamps[-1]:
            self._stamps.append(stamp_ns)
        return self._ready()

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """The camera's next image; images that are ready."""
        if self._images and matches.stamp_ns <= self._images[-1].stamp_ns:
            # Its clock was corrected backwards.
            self._images.clear()
            self._previous = None
            while self._stamps and self._stamps[0] < matches.stamp_ns:
                self._stamps.popleft()
        self._images.append(matches)
        while self._images[0].stamp_ns < matches.stamp_ns - _KEPT_NS:
            self._images.popleft()
        return self._ready()

    def flush(self) -> list[LandmarkMatches]:
        """What is left when no more images come."""
        return self._ready(last=True)

    def _ready(self, last: bool = False) -> list[LandmarkMatches]:
        ready = []
        while self._stamps and self._images:
            nearest = min(self._images, key=lambda image: abs(image.stamp_ns - self._stamps[0]))
            # The image after the next one gives the twist at the next.
            is_enclosed = len(self._images) > 1 and self._images[-2].stamp_ns >= self._stamps[0]
            if not (is_enclosed or last or nearest.stamp_ns == self._stamps[0]):
                break
            if (image := self._interpolate(nearest, self._stamps.popleft())) is not None:
                ready.append(image)
        return ready

    def _interpolate(self, nearest: LandmarkMatches, stamp_ns: int) -> LandmarkMatches | None:
        """The camera at a common stamp; None without an image near it."""
        off_s = 1e-9 * abs(stamp_ns - nearest.stamp_ns)
        if off_s == 0.0:
            return self._restamped(nearest, stamp_ns)
        if off_s > MAX_GAP_S / 2.0:
            return None
        known = [
            (image.stamp_ns, image.world_T_camera)
            for image in self._images
            if image.world_T_camera is not None and 1e-9 * abs(image.stamp_ns - stamp_ns) <= 2.0 * MAX_GAP_S
        ]
        # Two on either side make the curve.
        before, wanted = sum(own_ns <= stamp_ns for own_ns, _ in known), np.array([stamp_ns])
        known = known[max(0, before - 2) : before + 2]
        if nearest.world_T_camera is not None:
            path = CameraPath(*map(np.array, zip(*known, strict=True)))
            if path.covers(wanted, MAX_GAP_S)[0]:
                point = path.interpolate(wanted)
                covariance = nearest.pose_covariance + np.diag(point.variances[0])
                return self._restamped(nearest, stamp_ns, world_T_camera=point.poses[0], pose_covariance=covariance)
        return self._restamped(nearest, stamp_ns, world_T_camera=None)

    def _restamped(self, image: LandmarkMatches, stamp_ns: int, **changes: Any) -> LandmarkMatches:
        """An image without its landmarks at a common stamp, with the rotation since the one before, if known."""
        previous, self._previous = self._previous, (stamp_ns, image.stamp_ns)
        image = image.bare() if stamp_ns != image.stamp_ns else image
        if previous is None or previous[1] != image.previous_stamp_ns:
            return replace(image, stamp_ns=stamp_ns, previous_stamp_ns=0, rotation_inliers=0, **changes)
        stretch = (stamp_ns - previous[0]) / (image.stamp_ns - image.previous_stamp_ns)
        rotation = image.current_R_previous
        if stretch != 1.0:
            rotation = exp_so3(stretch * log_so3(rotation))
        return replace(image, stamp_ns=stamp_ns, previous_stamp_ns=previous[0], current_R_previous=rotation, **changes)
