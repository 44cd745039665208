"""A motion of the sample's body whose registrations are known, with all that a camera can have wrong."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.geometry import Array, exp_se3, exp_so3, rigid
from bodycam_ros.verdict.agreement_log import AgreementLog
from bodycam_ros.verdict.judge import judge
from bodycam_ros.verdict.verdict import Verdict
from bodycam_ros.verdict.verdict_settings import VerdictSettings

BODY = read_body(Path(__file__).parents[2] / "bags" / "body.yaml")
RATE_HZ, DURATION_S = 30.0, 4.0
START_NS = 1_700_000_000_000_000_000
_NOISE_RAD, _NOISE_M = 0.002, 0.004
"""Of a registration; on the sample cameras disagree by 4 to 15 mm about a joint."""

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
        solved: what the solver made of the true poses (S, 4, 4).
    """

    cameras: tuple[str, ...] = tuple(BODY.mounts)
    names: Mapping[str, str] = field(default_factory=dict)
    altered: Mapping[str, Alter] = field(default_factory=dict)
    clocks_s: Mapping[str, float] = field(default_factory=dict)
    solved: Callable[[Array], Array] = lambda poses: poses

    def log(self, span_s: float = np.inf, settings: VerdictSettings | None = None) -> AgreementLog:
        """All of it, heard in the order in which a replay hears it: bodies some frames behind."""
        log = AgreementLog(BODY, {}, settings or VerdictSettings(), inlier_px=2.5, span_s=span_s)
        random = np.random.default_rng(3)
        times = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
        heard = sorted(
            (time + self.clocks_s.get(camera, 0.0), time, camera) for time in times for camera in self.cameras
        )
        states = [(time, segment_poses(time)) for time in times]
        for stamp_s, time, camera in heard:
            while states and states[0][0] < stamp_s - 5.0 / RATE_HZ:
                self._solve(log, *states.pop(0))
            log.add_pose(self.names.get(camera, camera), _stamp_ns(stamp_s), self._registered(camera, time, random))
        for state in states:
            self._solve(log, *state)
        return log

    def verdict(self, settings: VerdictSettings | None = None) -> Verdict:
        """What comes of it."""
        settings = settings or VerdictSettings()
        return judge(self.log(settings=settings).agreement(), BODY, settings)

    def _registered(self, camera: str, time: float, random: np.random.Generator) -> Array | None:
        mount = BODY.mounts[camera]
        pose = segment_poses(time)[BODY.segment_index[mount.segment]] @ mount.segment_T_camera
        pose = pose @ exp_se3(random.normal(size=6) * np.repeat([_NOISE_RAD, _NOISE_M], 3))
        alter = self.altered.get(camera)
        return alter(time, pose) if alter else pose

    def _solve(self, log: AgreementLog, time: float, poses: Array) -> None:
        log.add_state(_stamp_ns(time), self.solved(poses))


def exchanged(*pairs: tuple[str, str]) -> dict[str, str]:
    """Names of cameras that were exchanged."""
    return {a: b for pair in pairs for a, b in (pair, pair[::-1])}


def moved(shift_m: tuple[float, float, float], after_s: float = -1.0) -> Alter:
    """A camera that sits elsewhere from some time on."""
    step = rigid(np.eye(3), np.array(shift_m))
    return lambda time, pose: pose @ step if time >= after_s else pose


def _stamp_ns(seconds: float) -> int:
    return START_NS + round(1e9 * seconds)
