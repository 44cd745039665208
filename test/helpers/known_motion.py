"""A motion of the sample's body whose registrations are known, with all that a camera can have wrong."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.geometry import Array, exp_se3, exp_so3, rigid
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.judge import judge
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.verdict import Verdict
from helpers.registered_pose import registered_pose

BODY = read_body(Path(__file__).parents[2] / "bags" / "body.yaml")
RATE_HZ, DURATION_S = 30.0, 4.0
START_NS = 1_700_000_000_000_000_000
_NOISE_RAD, _NOISE_M = 0.002, 0.004
"""Sigmas of a registration; on the sample cameras disagree by 4 to 15 mm about a joint."""

_SWING_RAD, _SWING_HZ = 0.6, 0.8

Alter = Callable[[float, Array], Array | None]
"""(time [s], registered pose (4, 4)) -> the pose that is registered instead, or None where it is not."""


@lru_cache(maxsize=1000)
def segment_poses(seconds: float) -> Array:
    """(S, 4, 4) of a person who walks and swings every joint."""
    phases = np.arange(len(BODY.tree_joints))[:, None] * np.array([1.0, 1.7, 2.3]) + 2.0 * np.pi * _SWING_HZ * seconds
    world_T_root = rigid(exp_so3(np.array([0.0, 0.0, 0.4 * seconds])), np.array([1.2 * seconds, 0.0, 0.9]))
    poses: Array = BODY.forward_kinematics(world_T_root, exp_so3(_SWING_RAD * np.sin(phases)))
    return poses


@dataclass(frozen=True)
class KnownMotion:
    """The motion as cameras saw it.

    Attributes:
        cameras: that there are.
        names: camera -> the name that it records under, where that is another's.
        altered: camera -> what is wrong with its poses.
        clocks_s: camera -> by how much its stamps are ahead [s].
        solved: what the solver made of the true poses (S, 4, 4) at a time [s].
        starts_s: when it begins [s].
    """

    cameras: tuple[str, ...] = tuple(BODY.mounts)
    names: Mapping[str, str] = field(default_factory=dict)
    altered: Mapping[str, Alter] = field(default_factory=dict)
    clocks_s: Mapping[str, float] = field(default_factory=dict)
    solved: Callable[[float, Array], Array] = lambda _, poses: poses
    starts_s: float = 0.0

    def registrations(self) -> Iterator[LandmarkMatches]:
        """Registrations of all images, in the order of their stamps."""
        random = np.random.default_rng(3)
        times = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
        images = [(time + self.clocks_s.get(camera, 0.0), time, camera) for time in times for camera in self.cameras]
        previous_ns: dict[str, int] = {}
        for stamp_s, time, camera in sorted(images):
            name, stamp_ns = self.names.get(camera, camera), self._stamp_ns(stamp_s)
            yield registered_pose(name, stamp_ns, previous_ns.get(name, 0), self._registered(camera, time, random))
            previous_ns[name] = stamp_ns

    def log(self) -> CameraPoseLog:
        """The log of all registrations and states, added in the order of a replay: states some frames behind."""
        log = CameraPoseLog(BODY, {}, inlier_px=2.5)
        states = [(self._stamp_ns(time), time) for time in np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ]
        for matches in self.registrations():
            while states and states[0][0] < matches.stamp_ns - 5e9 / RATE_HZ:
                stamp_ns, time = states.pop(0)
                log.add_state(stamp_ns, self.solved(time, segment_poses(time)))
            log.add_registration(matches)
        for stamp_ns, time in states:
            log.add_state(stamp_ns, self.solved(time, segment_poses(time)))
        return log

    def verdict(self) -> Verdict:
        """What comes of it."""
        return judge(self.log().poses())

    def _registered(self, camera: str, time: float, random: np.random.Generator) -> Array | None:
        mount = BODY.mounts[camera]
        pose = segment_poses(time)[BODY.segment_index[mount.segment]] @ mount.segment_T_camera
        pose = pose @ exp_se3(random.normal(size=6) * np.repeat([_NOISE_RAD, _NOISE_M], 3))
        alter = self.altered.get(camera)
        return alter(time, pose) if alter else pose

    def _stamp_ns(self, seconds: float) -> int:
        return START_NS + round(1e9 * (self.starts_s + seconds))


def exchanged(*pairs: tuple[str, str]) -> dict[str, str]:
    """Names of cameras that were exchanged."""
    return {a: b for pair in pairs for a, b in (pair, pair[::-1])}


def turned(degrees: float, after_s: float = -1.0) -> Alter:
    """A camera that is turned about its optical axis from some time on."""
    step = rigid(exp_so3(np.array([0.0, 0.0, np.radians(degrees)])), np.zeros(3))
    return lambda time, pose: pose @ step if time >= after_s else pose


def moved(shift_m: tuple[float, float, float], after_s: float = -1.0) -> Alter:
    """A camera that sits elsewhere from some time on."""
    step = rigid(np.eye(3), np.array(shift_m))
    return lambda time, pose: pose @ step if time >= after_s else pose
