"""Registered and solved camera poses at the same times, in bounded memory."""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.quality.lens_evidence import LensDeviation, LensEvidence
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_JUDGED_HZ = 10.0  # rate of the states that are kept: a wrong camera stays wrong
_RECENT = 256  # registrations of a camera that wait for a state: some seconds at 60 Hz
_MAX_ROWS = 3000  # of a longer recording every second state is dropped, repeatedly
_MAX_STEP_NS = 150_000_000  # between two registrations; limbs move straight for no longer
_JUMP_NS = 1_000_000_000  # back in time, which restarts the log; a smaller step is an image out of order
_PAUSE_NS = 1_000_000_000  # without an image of any camera
_LENS_INTERVAL, _FIRST_LENS_INTERVAL = 10, 3  # of the images that check the lens: neighbours show the same landmarks
_MIN_LENS_IMAGES = 3  # a single view may show landmarks that are off together


@dataclass
class CameraCount:
    """A camera's images so far.

    Attributes:
        first_ns, last_ns: stamps of the first and the last image [ns].
        images, registered: how many were tracked, and how many of them have a pose.
        first_registered_ns, last_registered_ns: stamps of the first and the last with a pose [ns]; 0 without any.
        blind_ns: longest time between two with a pose [ns].
        blind_until_ns: end of that time [ns].
        paused_until_ns: stamp at which all cameras went on after a pause, in which none was blind [ns]; 0 without one.
    """

    first_ns: int
    last_ns: int = 0
    images: int = 0
    registered: int = 0
    first_registered_ns: int = 0
    last_registered_ns: int = 0
    blind_ns: int = 0
    blind_until_ns: int = 0
    paused_until_ns: int = 0

    @property
    def share(self) -> float:
        """Share of the images that were registered."""
        return self.registered / self.images if self.images else 0.0

    def add(self, stamp_ns: int, *, is_registered: bool) -> None:
        """Count an image."""
        self.images, self.last_ns = self.images + 1, stamp_ns
        if is_registered:
            self._end_blindness(stamp_ns)
            self.first_registered_ns = self.first_registered_ns or stamp_ns
            self.registered, self.last_registered_ns = self.registered + 1, stamp_ns

    def extend(self, later: "CameraCount") -> None:
        """Count the images of the stretch of the recording after this one."""
        self.images, self.last_ns = self.images + later.images, later.last_ns
        if later.registered:
            self._end_blindness(later.first_registered_ns)
            if later.blind_ns > self.blind_ns:
                self.blind_ns, self.blind_until_ns = later.blind_ns, later.blind_until_ns
            self.first_registered_ns = self.first_registered_ns or later.first_registered_ns
            self.registered, self.last_registered_ns = self.registered + later.registered, later.last_registered_ns

    def _end_blindness(self, stamp_ns: int) -> None:
        blind_ns = stamp_ns - max(self.last_registered_ns or self.first_ns, self.paused_until_ns)
        if blind_ns > self.blind_ns:
            self.blind_ns, self.blind_until_ns = blind_ns, stamp_ns


@dataclass(frozen=True, eq=False)
class LoggedPoses:
    """What a log holds of a stretch of a recording; T rows are in the order of time.

    Attributes:
        stamps_ns: (T,) of its states [ns].
        registered: camera -> (T, 4, 4) pose by its own registration [m]; NaN where unknown.
        segments: (T, S, 4, 4) poses of the body's segments [m].
        counts: camera -> its images.
        lenses: camera -> images, information (4, 4) and gradient (4,) of the deviation of its lens.
    """

    stamps_ns: NDArray[np.int64]
    registered: Mapping[str, Array]
    segments: Array
    counts: Mapping[str, CameraCount]
    lenses: Mapping[str, tuple[int, Array, Array]]


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """C cameras on a body at T states; rows are in the order of time.

    Attributes:
        body: segments, joints and mounts.
        cameras: names of the body cameras with images.
        seconds: (T,) since ``start_ns`` [s].
        start_ns: stamp of the first image [ns].
        registered: camera -> (T, 4, 4) poses of its optical frame by its own registration [m]; NaN where unknown.
        solved: mount -> (T, 4, 4) pose of a camera on it by the solved body [m]; of cameras without images, too.
        counts: camera -> its images.
        lens_errors: camera -> deviation of its lens from its model; absent where unknown.
    """

    body: BodyModel
    cameras: tuple[str, ...]
    seconds: Array
    start_ns: int
    registered: Mapping[str, Array]
    solved: Mapping[str, Array]
    counts: Mapping[str, CameraCount]
    lens_errors: Mapping[str, LensDeviation]

    def speeds(self) -> dict[str, tuple[float, float]]:
        """Camera -> median speed of its turn [rad/s] and of its motion [m/s]; absent where it was not registered."""
        medians: dict[str, tuple[float, float]] = {}
        for camera, world_T_camera in self.registered.items():
            steps = log_se3(inverse(world_T_camera[:-1]) @ world_T_camera[1:]).reshape(-1, 2, 3)
            sizes = np.linalg.norm(steps, axis=2) / np.diff(self.seconds)[:, None]
            if (known := np.isfinite(sizes[:, 0])).any():
                turning, moving = np.median(sizes[known], axis=0).tolist()
                medians[camera] = turning, moving
        return medians


class CameraPoseLog:
    """Collects registrations and solved states in order of time.

    A state gets the pose of a camera if the registrations before and after it were added before that state.

    Args:
        body: segments, joints and mounts.
        cameras: models by name, to check lenses by landmarks; without them lenses are not checked.
        inlier_px: gate of landmarks that lenses are checked with [px].
        span_s: only this much of the past is kept [s]; infinite for all, ever coarser.
        start_ns: stamp of the recording's time 0 [ns]; None for that of the first image.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        inlier_px: float,
        span_s: float = math.inf,
        start_ns: int | None = None,
    ) -> None:
        self._body = body
        self._models = cameras
        self._inlier_px = inlier_px
        self._span_ns = 1e9 * span_s
        self._lenses: dict[str, LensEvidence] = {}
        self._given_start_ns = start_ns
        self._reset()

    def _reset(self) -> None:
        self._recent: dict[str, deque[tuple[int, Array]]] = {}
        self._rows: deque[tuple[int, dict[str, Array], NDArray[np.float64]]] = deque()
        self._counts: dict[str, CameraCount] = {}
        self._step_ns = round(1e9 / _JUDGED_HZ)
        self._start_ns = self._given_start_ns
        self._latest_ns = 0

    def add_registration(self, matches: LandmarkMatches) -> None:
        """Add the registration of one image."""
        camera, stamp_ns, world_T_camera = matches.camera, matches.stamp_ns, matches.world_T_camera
        last_ns = self._counts[camera].last_ns if camera in self._counts else 0
        if camera not in self._body.mounts or last_ns - _JUMP_NS <= stamp_ns <= last_ns:
            return
        if stamp_ns < last_ns:
            self._reset()
        self._start_ns = stamp_ns if self._start_ns is None else self._start_ns
        self._end_pause(stamp_ns)
        self._latest_ns = max(self._latest_ns, stamp_ns)
        count = self._counts.setdefault(camera, CameraCount(stamp_ns))
        count.add(stamp_ns, is_registered=world_T_camera is not None)
        if world_T_camera is None:
            return
        self._recent.setdefault(camera, deque(maxlen=_RECENT)).append((stamp_ns, world_T_camera))
        interval = _FIRST_LENS_INTERVAL if count.registered <= 2 * _LENS_INTERVAL else _LENS_INTERVAL
        if camera in self._models and (count.registered - 1) % interval == 0:
            self._lenses.setdefault(camera, LensEvidence(self._models[camera], self._inlier_px)).add(matches)

    def _end_pause(self, stamp_ns: int) -> None:
        """Note a pause of all cameras, as between the parts of a preview, if one ends at a stamp [ns]."""
        if stamp_ns - self._latest_ns > _PAUSE_NS:
            for count in self._counts.values():
                count.paused_until_ns = stamp_ns

    def add_state(self, stamp_ns: int, world_T_segment: NDArray[np.float64]) -> None:
        """Add a solved state: poses (S, 4, 4) of all segments of the body."""
        if self._rows and stamp_ns - self._rows[-1][0] < 0.95 * self._step_ns:
            return
        found = {camera: _interpolate_pose(recent, stamp_ns) for camera, recent in self._recent.items()}
        poses = {camera: pose for camera, pose in found.items() if pose is not None}
        self._rows.append((stamp_ns, poses, world_T_segment))
        while stamp_ns - self._rows[0][0] > self._span_ns:
            self._rows.popleft()
        self._thin_out()

    def _thin_out(self) -> None:
        while len(self._rows) > _MAX_ROWS:
            self._rows = deque(list(self._rows)[::2])
            self._step_ns *= 2

    def logged(self) -> LoggedPoses:
        """All that is kept, for the log of a recording that was solved in stretches."""
        unknown = np.full((4, 4), np.nan)
        return LoggedPoses(
            stamps_ns=np.array([stamp_ns for stamp_ns, _, _ in self._rows], np.int64),
            registered={c: np.array([poses.get(c, unknown) for _, poses, _ in self._rows]) for c in self._counts},
            segments=np.array([state for _, _, state in self._rows]),
            counts=self._counts,
            lenses={camera: lens.sums for camera, lens in self._lenses.items()},
        )

    def extend(self, later: LoggedPoses) -> None:
        """Add the stretch of the recording after what is kept."""
        if later.counts:
            self._end_pause(min(count.first_ns for count in later.counts.values()))
            self._latest_ns = max(count.last_ns for count in later.counts.values())
        for camera, count in later.counts.items():
            if camera in self._counts:
                self._counts[camera].extend(count)
            else:
                self._counts[camera] = count
        known = {camera: np.isfinite(own[:, 0, 0]) for camera, own in later.registered.items()}
        for row, (stamp_ns, state) in enumerate(zip(later.stamps_ns.tolist(), later.segments, strict=True)):
            poses = {camera: own[row] for camera, own in later.registered.items() if known[camera][row]}
            self._rows.append((stamp_ns, poses, state))
        self._thin_out()
        for camera, sums in later.lenses.items():
            self._lenses.setdefault(camera, LensEvidence(self._models[camera], self._inlier_px)).add_sums(*sums)

    def poses(self) -> CameraPoses:
        """The poses that are kept."""
        body, start_ns = self._body, self._start_ns or 0
        cameras = tuple(camera for camera in body.mounts if camera in self._counts)
        unknown = np.full((4, 4), np.nan)
        rows = {c: np.array([poses.get(c, unknown) for _, poses, _ in self._rows]) for c in cameras}
        world_T_segment = np.array([state for _, _, state in self._rows]).reshape(-1, len(body.segments), 4, 4)
        mounts = ((c, body.segment_index[mount.segment], mount) for c, mount in body.mounts.items())
        return CameraPoses(
            body=body,
            cameras=cameras,
            seconds=np.array([1e-9 * (stamp_ns - start_ns) for stamp_ns, _, _ in self._rows]),
            start_ns=start_ns,
            registered={camera: poses.reshape(-1, 4, 4) for camera, poses in rows.items()},
            solved={c: world_T_segment[:, segment] @ mount.segment_T_camera for c, segment, mount in mounts},
            counts=self._counts,
            lens_errors={c: lens.error() for c, lens in self._lenses.items() if lens.images >= _MIN_LENS_IMAGES},
        )


def _interpolate_pose(recent: deque[tuple[int, Array]], stamp_ns: int) -> Array | None:
    """Pose (4, 4) of a camera at a time between two of its registrations; None if they are far apart."""
    after = max(1, bisect_left(recent, stamp_ns, key=itemgetter(0)))
    if after >= len(recent) or recent[0][0] > stamp_ns:
        return None
    (before_ns, world_T_before), (after_ns, world_T_after) = recent[after - 1], recent[after]
    step_ns = after_ns - before_ns
    if step_ns > _MAX_STEP_NS:
        return None
    step = log_se3(inverse(world_T_before) @ world_T_after)
    return world_T_before @ exp_se3(step * ((stamp_ns - before_ns) / step_ns))
