"""A body of which everything is known, before cameras that somebody started by hand, each with a clock of its own."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.arrivals import Arrivals
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_state import ClockSettings
from helpers.range_of_motion import START_NS, known_body, range_of_motion
from helpers.registered_pose import registered_pose

Array = NDArray[np.float64]

BODY = known_body()
CAMERAS = tuple(BODY.mounts)
REFERENCE = "waist_front"
RATE_HZ = 30.0
NOISE_RAD, NOISE_M = 0.002, 0.003
FLOOR = np.diag(np.repeat([1e-4**2, 1e-4**2], 3))
FREE_S = {camera: number * 0.0211 % (1.0 / RATE_HZ) for number, camera in enumerate(CAMERAS)}
"""Camera -> phase of one that nothing triggers with the others [s]."""


@dataclass(frozen=True)
class CameraRun:
    """How one camera ran.

    Attributes:
        phase_s: when its first image was taken [s].
        ahead_s: by how much its clock is ahead at first [s].
        drift: by which that grows per second.
        jumps: (when [s], by how much [s]) its clock was set.
        on_s: when it was on, from and to [s].
        off_s: when it saw nothing in between, from and to [s].
    """

    phase_s: float = 0.0
    ahead_s: float = 0.0
    drift: float = 0.0
    jumps: tuple[tuple[float, float], ...] = ()
    on_s: tuple[float, float] = (-1.0, 1e9)
    off_s: tuple[float, float] = (1e9, 1e9)

    def times_s(self, duration_s: float) -> Array:
        """(N) when its images were taken [s]."""
        times: Array = self.phase_s + np.arange(round((duration_s - self.phase_s) * RATE_HZ)) / RATE_HZ
        on = (times >= self.on_s[0]) & (times < self.on_s[1])
        return times[on & ~((times >= self.off_s[0]) & (times < self.off_s[1]))]

    def offset_s(self, times_s: Array | float) -> Array:
        """Lead of the clock at some times [s]."""
        times = np.asarray(times_s, np.float64)
        return np.asarray(
            self.ahead_s + self.drift * times + sum(by_s * (times >= when_s) for when_s, by_s in self.jumps)
        )


@dataclass(frozen=True)
class Recording:
    """Registrations of the cameras of the known body.

    Attributes:
        duration_s: of the range of motion [s].
        runs: camera -> how it ran; the others as ``CameraRun()``.
        cameras: that there are.
        noise: of the registrations, as a share of the usual one.
        seed: of that noise.
    """

    duration_s: float = 14.0
    runs: Mapping[str, CameraRun] = field(default_factory=dict)
    cameras: tuple[str, ...] = CAMERAS
    noise: float = 1.0
    seed: int = 1

    def run(self, camera: str) -> CameraRun:
        return self.runs.get(camera, CameraRun())

    def images(self) -> list[LandmarkMatches]:
        """Their registrations, in the order of when they were taken."""
        return [image for _, _, image in sorted(self._taken(), key=lambda each: each[:2])]

    def times_ns(self, camera: str) -> NDArray[np.int64]:
        """(N) when its images were taken, by the clock that is right [ns]."""
        times = [time_s for time_s, name, _ in self._taken() if name == camera]
        return START_NS + np.round(1e9 * np.array(times)).astype(np.int64)

    def _taken(self) -> Iterator[tuple[float, str, LandmarkMatches]]:
        sigmas = self.noise * np.repeat([NOISE_RAD, NOISE_M], 3)
        for camera in self.cameras:
            run = self.run(camera)
            times_s = run.times_s(self.duration_s)
            random = np.random.default_rng([self.seed, *camera.encode()])
            errors = sigmas * random.normal(size=(len(times_s), 6))
            rows = np.round((times_s - run.phase_s) * RATE_HZ).astype(int)
            poses = _true_poses(round(1e6 * run.phase_s), self.duration_s)[camera][rows] @ exp_se3(errors)
            stamps_ns = START_NS + np.round(1e9 * (times_s + run.offset_s(times_s))).astype(np.int64)
            previous_ns = -(10**18)
            for time_s, stamp_ns, pose in zip(times_s.tolist(), stamps_ns.tolist(), poses, strict=True):
                if stamp_ns > previous_ns:  # Trackers leave out images whose stamps do not increase.
                    yield time_s, camera, registered_pose(camera, stamp_ns, previous_ns, pose, np.diag(sigmas**2))
                    previous_ns = stamp_ns


@cache
def _true_poses(phase_us: int, duration_s: float) -> Mapping[str, Array]:
    return range_of_motion(BODY, duration_s, RATE_HZ, delay_s=1e-6 * phase_us).world_T_camera


def free_running(**altered: CameraRun) -> dict[str, CameraRun]:
    """Every camera in a phase of its own; what is altered of some besides their phase."""
    return {camera: replace(altered.get(camera, CameraRun()), phase_s=round(FREE_S[camera], 6)) for camera in CAMERAS}


def watched(
    images: Iterable[LandmarkMatches],
    settings: ClockSettings | None = None,
    live: bool = False,
    cameras: Iterable[str] = CAMERAS,
) -> tuple[ClockEstimator, list[LandmarkMatches]]:
    """A clock estimator that has processed all images, and the images that it passed on."""
    watch, passed = ClockEstimator(BODY, cameras, settings or ClockSettings(), FLOOR, live), list[LandmarkMatches]()
    arrivals = Arrivals(cameras, None, live, watch, passed.append)
    for image in images:
        arrivals.add(image)
    arrivals.flush()
    return watch, passed
