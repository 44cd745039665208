"""The registrations of a free-running camera at the instants at which the body is solved.

Its pose is read off its path between the image before and the image after; where one of them is missing, the nearest
image is moved along by its twist, if it is near. The landmarks go with the pose, residuals and all, so that who comes
after sees an image taken at the instant. docs/architecture.md has the alternatives, and what they were measured to do.

Between two images the pose is ``first @ exp(h(s))``, ``h`` a cubic Hermite curve of tangent vectors whose slopes at
both ends are the twists there, each from the parabola through three images (Kim et al. 1995 do so with quaternions).
At 24 images a second, in swings of 1 to 3 Hz that reach 100 rad/s^2, it is off by up to 0.14 deg, a line by 1.2.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import adjoint, exp_se3, exp_so3, inverse, log_se3, log_so3, transform_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PathPoints:
    """Points of a path.

    Attributes:
        poses: (K, 4, 4).
        twists: (K, 6) rotation [rad/s] then translation [m/s], in the camera's axes; between images those of the images
            by their shares.
        before: (K) row of the image before, or of the image itself.
        shares: (K) how far from that image to the next, 0 to 1.
    """

    poses: Array
    twists: Array
    before: NDArray[np.intp]
    shares: Array

    @property
    def nearest(self) -> NDArray[np.intp]:
        """(K) row of the nearest image."""
        return self.before + (self.shares >= 0.5)


class CameraPath:
    """A path through registered poses.

    Args:
        stamps_ns: (N) of the images, ascending [ns].
        world_T_camera: (N, 4, 4) their poses.
    """

    def __init__(self, stamps_ns: NDArray[np.int64], world_T_camera: Array) -> None:
        self.stamps_ns = stamps_ns
        self.world_T_camera = world_T_camera
        self._gaps_s = 1e-9 * np.diff(stamps_ns).astype(np.float64)
        self._steps = log_se3(inverse(world_T_camera[:-1]) @ world_T_camera[1:])
        self._twists = _twists(self._steps, self._gaps_s)

    def inside(self, stamps_ns: NDArray[np.int64], max_gap_ns: float) -> NDArray[np.bool_]:
        """Which instants (K) are those of an image, or lie between two that are close together."""
        after = np.searchsorted(self.stamps_ns, stamps_ns)
        exact = self.stamps_ns[np.minimum(after, len(self.stamps_ns) - 1)] == stamps_ns
        between = (after > 0) & (after < len(self.stamps_ns))
        close = np.zeros(len(stamps_ns), bool)
        close[between] = 1e9 * self._gaps_s[after[between] - 1] <= max_gap_ns
        inside: NDArray[np.bool_] = exact | close
        return inside

    def at(self, stamps_ns: NDArray[np.int64]) -> PathPoints:
        """The path at instants (K) between its first image and its last [ns]."""
        before = np.clip(np.searchsorted(self.stamps_ns, stamps_ns, side="right") - 1, 0, len(self.stamps_ns) - 1)
        if len(self.stamps_ns) == 1:
            return PathPoints(self.world_T_camera[before], np.zeros((len(before), 6)), before, np.zeros(len(before)))
        start = np.minimum(before, len(self._gaps_s) - 1)
        gaps_s = self._gaps_s[start][:, None]
        s = 1e-9 * (stamps_ns - self.stamps_ns[start]).astype(np.float64)[:, None] / gaps_s
        step, first, last = self._steps[start], gaps_s * self._twists[start], gaps_s * self._twists[start + 1]
        curve = s * first + s**2 * (3 * step - 2 * first - last) + s**3 * (first + last - 2 * step)
        # The curve's own slope shares its errors with the curve: clocks learned with it are off by milliseconds.
        twists = (1.0 - s) * self._twists[start] + s * self._twists[start + 1]
        return PathPoints(self.world_T_camera[start] @ exp_se3(curve), twists, start, s[:, 0])


def _twists(steps: Array, gaps_s: Array) -> Array:
    """Twists (N, 6) at the images, from the steps (N-1, 6) between them; at the ends those of the outer steps."""
    if not len(steps):
        return np.zeros((1, 6))
    means = steps / gaps_s[:, None]
    first, second = gaps_s[:-1, None], gaps_s[1:, None]
    inner = (second * means[:-1] + first * means[1:]) / (first + second)
    return np.concatenate([means[:1], inner, means[-1:]])


def nearest_rows(stamps_ns: NDArray[np.int64], wanted_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    """Row of the stamp (N, ascending) that is nearest to each wanted one (K)."""
    after = np.clip(np.searchsorted(stamps_ns, wanted_ns), 1, max(1, len(stamps_ns) - 1))
    before, after = after - 1, np.minimum(after, len(stamps_ns) - 1)
    rows: NDArray[np.intp] = np.where(wanted_ns - stamps_ns[before] <= stamps_ns[after] - wanted_ns, before, after)
    return rows


_REMEMBERED_NS = 1_000_000_000
"""Images are kept for so long: live, instants may be known only after the camera has gone on."""

_FORGOTTEN_NS = 30_000_000_000
"""A camera that says nothing for so long will not speak of that time any more."""

_BEND = np.repeat([60.0, 15.0], 3)
"""Accelerations of a limb [rad/s^2, m/s^2]: what a twist does not know of the way to an instant."""


class InstantSampler:
    """Brings one camera to the instants of the body.

    Args:
        camera: its model.
        max_gap_s: between two images that have a path between them [s].
    """

    def __init__(self, camera: CameraModel, max_gap_s: float) -> None:
        self._camera = camera
        self._max_gap_ns = round(1e9 * max_gap_s)
        self._images: deque[LandmarkMatches] = deque()
        self._instants: deque[int] = deque()
        self._previous: tuple[int, int] | None = None

    def add_instant(self, stamp_ns: int) -> list[LandmarkMatches]:
        """One more instant, later than those before; what can be said by now."""
        if not self._instants or stamp_ns > self._instants[-1]:
            self._instants.append(stamp_ns)
        while self._instants[0] < stamp_ns - _FORGOTTEN_NS:
            self._instants.popleft()
        return self._speak(last=False)

    def add(self, matches: LandmarkMatches) -> list[LandmarkMatches]:
        """The camera's next image; what it says of the instants that it completes."""
        if self._images and matches.stamp_ns <= self._images[-1].stamp_ns:
            # Its time begins anew.
            self._images.clear()
            self._previous = None
            self._instants = deque(stamp for stamp in self._instants if stamp >= matches.stamp_ns)
        self._images.append(matches)
        while self._images[0].stamp_ns < matches.stamp_ns - _REMEMBERED_NS:
            self._images.popleft()
        return self._speak(last=False)

    def flush(self) -> list[LandmarkMatches]:
        """What can be said without any more images."""
        return self._speak(last=True)

    def _speak(self, last: bool) -> list[LandmarkMatches]:
        spoken = []
        while self._instants and self._images:
            # The image after the next one says how the camera moves at the next.
            ready = len(self._images) > 1 and self._images[-2].stamp_ns >= self._instants[0]
            if not (ready or last or self._nearest(self._instants[0]).stamp_ns == self._instants[0]):
                break
            instant_ns = self._instants.popleft()
            if (said := self._at(instant_ns)) is not None:
                spoken.append(said)
        return spoken

    def _nearest(self, instant_ns: int) -> LandmarkMatches:
        """The image that is nearest to an instant; of two the earlier."""
        nearest = self._images[-1]
        # Most instants are among the latest images.
        for image in reversed(self._images):
            if abs(image.stamp_ns - instant_ns) > abs(nearest.stamp_ns - instant_ns):
                break
            nearest = image
        return nearest

    def _registered_near(self, instant_ns: int) -> list[LandmarkMatches]:
        """Registered images that make a curve: two on either side of an instant, as far as they are near."""
        before: list[LandmarkMatches] = []
        after: list[LandmarkMatches] = []
        for image in reversed(self._images):
            if len(before) == 2 or image.stamp_ns < instant_ns - 2 * self._max_gap_ns:
                break
            if image.world_T_camera is not None:
                (before if image.stamp_ns <= instant_ns else after).append(image)
        near = [image for image in after[-2:] if image.stamp_ns <= instant_ns + 2 * self._max_gap_ns]
        return [*reversed(before), *reversed(near)]

    def _at(self, instant_ns: int) -> LandmarkMatches | None:
        """What the camera says of an instant; None if it has no image near it."""
        nearest = self._nearest(instant_ns)
        off_ns = instant_ns - nearest.stamp_ns
        if off_ns == 0:
            return self._with_turn(nearest, instant_ns)
        if abs(off_ns) > self._max_gap_ns // 2:
            return None
        registered = self._registered_near(instant_ns)
        if nearest.world_T_camera is None or len(registered) < 2:
            return self._turned(nearest, instant_ns)
        path = CameraPath(
            np.array([image.stamp_ns for image in registered], np.int64),
            np.stack([image.world_T_camera for image in registered if image.world_T_camera is not None]),
        )
        stamp = np.array([instant_ns], np.int64)
        if path.inside(stamp, self._max_gap_ns)[0]:
            pose, covariance = path.at(stamp).poses[0], nearest.pose_covariance
        else:
            off_s = 1e-9 * off_ns
            twist = path.at(np.array([nearest.stamp_ns], np.int64)).twists[0]
            step = exp_se3(off_s * twist)
            pose = nearest.world_T_camera @ step
            carried = adjoint(inverse(step))
            covariance = carried @ nearest.pose_covariance @ carried.T + np.diag((0.5 * off_s**2 * _BEND) ** 2)
        return self._with_turn(
            nearest,
            instant_ns,
            world_T_camera=pose,
            pose_covariance=covariance,
            pixels=self._carried(nearest, pose),
        )

    def _carried(self, image: LandmarkMatches, world_T_camera: Array) -> NDArray[np.float32]:
        """Where landmarks would be in an image taken at a pose (4, 4): as far off their projections as they are."""
        assert image.world_T_camera is not None
        views = inverse(np.array([world_T_camera, image.world_T_camera]))
        points = transform_points(views, image.points_world.astype(np.float64))
        # Both views in one call: with a hundred landmarks a call costs more than what it computes.
        pixels, valid = self._camera.project(points.reshape(-1, 3))
        (there, here), (valid_there, valid_here) = pixels.reshape(2, -1, 2), valid.reshape(2, -1)
        moved = np.where((valid_there & valid_here)[:, None], there - here, 0.0)
        return (image.pixels + moved).astype(np.float32)

    def _turned(self, image: LandmarkMatches, instant_ns: int) -> LandmarkMatches:
        """An unregistered image, its landmarks moved by the camera's turning alone."""
        since_ns = image.stamp_ns - image.previous_stamp_ns
        if not image.rotation_inliers or since_ns <= 0:
            return self._with_turn(image, instant_ns, world_T_camera=None)
        share = (instant_ns - image.stamp_ns) / since_ns
        bearings, in_view = self._camera.unproject(image.pixels)
        later_R_now = exp_so3(share * log_so3(image.current_R_previous))
        pixels, valid = self._camera.project(bearings @ later_R_now.T)
        pixels = np.where((in_view & valid)[:, None], pixels, image.pixels)
        return self._with_turn(image, instant_ns, world_T_camera=None, pixels=pixels.astype(np.float32))

    def _with_turn(self, image: LandmarkMatches, instant_ns: int, **shown: Any) -> LandmarkMatches:
        """An image as it is shown, stamped with the instant, with the rotation since the instant before, if known."""
        before, self._previous = self._previous, (instant_ns, image.stamp_ns)
        if before is None or before[1] != image.previous_stamp_ns:
            return replace(image, stamp_ns=instant_ns, previous_stamp_ns=0, rotation_inliers=0, **shown)
        stretch = (instant_ns - before[0]) / (image.stamp_ns - image.previous_stamp_ns)
        turn = image.current_R_previous
        if stretch != 1.0:
            turn = exp_so3(stretch * log_so3(turn))
        return replace(image, stamp_ns=instant_ns, previous_stamp_ns=before[0], current_R_previous=turn, **shown)
