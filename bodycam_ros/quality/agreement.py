"""Registered and solved camera poses at the same times, in bounded memory."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.quality.lens_evidence import LensDeviation, LensEvidence
from bodycam_ros.quality.thresholds import JUDGED_HZ
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_RECENT = 256
"""Registrations of a camera that are kept until their time is solved: some seconds at 60 Hz."""

_MOST_ROWS = 3000
"""Times that are kept; of a longer recording every second one is dropped, repeatedly."""

_LONGEST_STEP_NS = 150_000_000
"""Longest step between two registrations that a pose is interpolated in: limbs move straight for no longer."""

_JUMP_NS = 1_000_000_000
"""A larger step back in time restarts the log; a smaller one is an image out of order, which is dropped."""

_LENS_INTERVAL, _FIRST_LENS_INTERVAL = 10, 3
"""Interval of registered images that the lens is checked with: neighbours show the same landmarks. At first shorter."""

_TURNS, _MOVES = slice(0, 3), slice(3, 6)
"""Of a twist."""

_LEAST_LENS_IMAGES = 3
"""A single view may show landmarks that are off together."""


@dataclass(frozen=True)
class CameraCount:
    """A camera's images so far.

    Attributes:
        images: that were tracked.
        registered: of them with a pose.
        first_ns: stamp of the first image [ns].
        last_ns: stamp of the last image [ns].
        last_registered_ns: stamp of the last with a pose [ns]; 0 if there was none.
        blind_ns: longest time between two with a pose [ns].
        blind_until_ns: stamp at which that time was over [ns].
    """

    images: int = 0
    registered: int = 0
    first_ns: int = 0
    last_ns: int = 0
    last_registered_ns: int = 0
    blind_ns: int = 0
    blind_until_ns: int = 0

    @property
    def share(self) -> float:
        """Of the images that were registered."""
        return self.registered / self.images if self.images else 0.0


@dataclass(frozen=True, eq=False)
class Agreement:
    """C cameras at T instants; rows are in the order of time.

    Attributes:
        cameras: names of the body cameras with images.
        seconds: (T,) since ``start_ns`` [s].
        start_ns: stamp of the first image [ns].
        world_T_registered: (T, C, 4, 4) poses of the optical frames by their own registration [m]; NaN where unknown.
        twists: (T, C, 6) velocity of these poses in their own axes [rad/s, m/s]; NaN where unknown.
        world_T_solved: (T, C, 4, 4) where the solved body has them [m].
        counts: camera -> its images.
        lens_errors: camera -> by how much its lens is not what its model says; absent where unknown.
    """

    cameras: tuple[str, ...]
    seconds: Array
    start_ns: int
    world_T_registered: Array
    twists: Array
    world_T_solved: Array
    counts: Mapping[str, CameraCount]
    lens_errors: Mapping[str, LensDeviation]

    def registered(self, camera: str) -> Array:
        """(T, 4, 4) registered poses of a camera."""
        return self.world_T_registered[:, self.cameras.index(camera)]

    def solved(self, camera: str) -> Array:
        """(T, 4, 4) solved poses of a camera."""
        return self.world_T_solved[:, self.cameras.index(camera)]

    def speeds(self) -> dict[str, tuple[float, float]]:
        """Camera -> how fast it turned [rad/s] and moved [m/s], median; absent where it was not registered."""
        speeds = {}
        for camera, twists in zip(self.cameras, np.moveaxis(self.twists, 1, 0), strict=True):
            known = twists[np.isfinite(twists[:, 0])]
            if len(known):
                turning, moving = (np.median(np.linalg.norm(known[:, part], axis=1)) for part in (_TURNS, _MOVES))
                speeds[camera] = float(turning), float(moving)
        return speeds


class AgreementLog:
    """Collects registrations and solved states in order of time.

    Registrations count for a state if the one before it and the one after it were added before that state.

    Args:
        body: segments, joints and mounts.
        cameras: models by name, to check lenses by landmarks; without them lenses are not checked.
        inlier_px: gate of landmarks that lenses are checked with [px].
        span_s: only this much of the past is kept [s]; infinite for all, ever coarser.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        inlier_px: float,
        span_s: float = math.inf,
    ) -> None:
        self._body = body
        self._models = cameras
        self._inlier_px = inlier_px
        self._span_ns = 1e9 * span_s
        self._first_step_ns = self._step_ns = round(1e9 / JUDGED_HZ)
        self._lenses: dict[str, LensEvidence] = {}
        self._reset()

    def _reset(self) -> None:
        self._recent: dict[str, deque[tuple[int, Array]]] = {}
        self._rows: deque[tuple[int, dict[str, tuple[Array, Array]], NDArray[np.float64]]] = deque()
        self._counts: dict[str, CameraCount] = {}
        self._step_ns = self._first_step_ns
        self._start_ns: int | None = None

    def add_registration(self, matches: LandmarkMatches) -> None:
        """Add the registration of one image."""
        self.add_pose(matches.camera, matches.stamp_ns, matches.world_T_camera)
        model = self._models.get(matches.camera)
        if model is None or matches.world_T_camera is None or matches.camera not in self._counts:
            return
        number = self._counts[matches.camera].registered - 1
        if number % (_FIRST_LENS_INTERVAL if number < 2 * _LENS_INTERVAL else _LENS_INTERVAL) == 0:
            self._lenses.setdefault(matches.camera, LensEvidence(model, self._inlier_px)).add(matches)

    def add_pose(self, camera: str, stamp_ns: int, world_T_camera: Array | None) -> None:
        """Add one image of a camera: its registered pose (4, 4), or None without."""
        if camera not in self._body.mounts:
            return
        count = self._counts.get(camera, CameraCount(first_ns=stamp_ns))
        if stamp_ns < count.last_ns - _JUMP_NS:
            # Time restarts: earlier registrations do not belong to later ones.
            self._reset()
            count = CameraCount(first_ns=stamp_ns)
        elif stamp_ns <= count.last_ns:
            return
        self._start_ns = stamp_ns if self._start_ns is None else self._start_ns
        count = replace(count, images=count.images + 1, last_ns=stamp_ns)
        if world_T_camera is not None:
            blind_ns = stamp_ns - (count.last_registered_ns or count.first_ns)
            if blind_ns > count.blind_ns:
                count = replace(count, blind_ns=blind_ns, blind_until_ns=stamp_ns)
            count = replace(count, registered=count.registered + 1, last_registered_ns=stamp_ns)
            self._recent.setdefault(camera, deque(maxlen=_RECENT)).append((stamp_ns, world_T_camera))
        self._counts[camera] = count

    def add_state(self, stamp_ns: int, world_T_segment: NDArray[np.float64]) -> None:
        """Add a solved instant: poses (S, 4, 4) of all segments of the body."""
        if self._rows and stamp_ns - self._rows[-1][0] < 0.95 * self._step_ns:
            return
        places = {
            camera: place
            for camera, recent in self._recent.items()
            if (place := _interpolate_pose(recent, stamp_ns)) is not None
        }
        self._rows.append((stamp_ns, places, world_T_segment))
        while stamp_ns - self._rows[0][0] > self._span_ns:
            self._rows.popleft()
        if len(self._rows) > _MOST_ROWS:
            self._rows = deque(list(self._rows)[::2])
            self._step_ns *= 2

    def agreement(self) -> Agreement:
        """The poses that are kept."""
        cameras = tuple(camera for camera in self._body.mounts if camera in self._counts)
        shape = (len(self._rows), len(cameras))
        registered, twists = np.full((*shape, 4, 4), np.nan), np.full((*shape, 6), np.nan)
        column = {camera: number for number, camera in enumerate(cameras)}
        for row, (_, places, _) in enumerate(self._rows):
            for camera, (pose, twist) in places.items():
                registered[row, column[camera]], twists[row, column[camera]] = pose, twist
        start_ns = self._start_ns or 0
        return Agreement(
            cameras=cameras,
            seconds=np.array([1e-9 * (stamp_ns - start_ns) for stamp_ns, _, _ in self._rows]),
            start_ns=start_ns,
            world_T_registered=registered,
            twists=twists,
            world_T_solved=self._solved(cameras),
            counts=dict(self._counts),
            lens_errors={
                camera: lens.error() for camera, lens in self._lenses.items() if lens.images >= _LEAST_LENS_IMAGES
            },
        )

    def _solved(self, cameras: tuple[str, ...]) -> Array:
        """(T, C, 4, 4) where the body has the cameras."""
        if not self._rows or not cameras:
            return np.zeros((len(self._rows), len(cameras), 4, 4))
        mounts = [self._body.mounts[camera] for camera in cameras]
        world_T_segment = np.stack([poses for _, _, poses in self._rows])
        carriers = [self._body.segment_index[mount.segment] for mount in mounts]
        solved: Array = world_T_segment[:, carriers] @ np.stack([mount.segment_T_camera for mount in mounts])
        return solved


def _interpolate_pose(recent: deque[tuple[int, Array]], stamp_ns: int) -> tuple[Array, Array] | None:
    """Pose (4, 4) and twist (6) of a camera at a time between two of its registrations; None if they are far apart."""
    after = next((number for number in range(len(recent)) if recent[number][0] >= stamp_ns), None)
    if after is None:
        return None
    if after == 0:
        if recent[0][0] > stamp_ns or len(recent) < 2:
            return None
        after = 1
    (before_ns, world_T_before), (after_ns, world_T_after) = recent[after - 1], recent[after]
    step_ns = after_ns - before_ns
    if step_ns > _LONGEST_STEP_NS:
        return None
    step = log_se3(inverse(world_T_before) @ world_T_after)
    return world_T_before @ exp_se3(step * ((stamp_ns - before_ns) / step_ns)), step / (1e-9 * step_ns)
