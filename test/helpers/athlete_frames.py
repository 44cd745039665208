"""Registrations of the cameras on an athlete, with noise and losses, and the states that are solved from them."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.estimation.attachments import CouplingSettings
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.estimator import BodyEstimator
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import exp_se3, exp_so3, inverse
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from helpers.athletes import AIRBORNE_S, BODY, RATE_HZ, Athlete, binding
from helpers.moving_body import lenses

Array = NDArray[np.float64]
Stretches = tuple[tuple[float, float], ...]

NOISE = np.repeat([np.radians(0.1), 0.002], 3)
"""Sigmas of a registration: rotation [rad], position [m]."""

TURN_NOISE_RAD = np.radians(0.05)
BLUR = 5.0
"""Factor of the noise of a blurred image, and of the sigmas that its registration has."""

START_NS = 1_000_000_000
LEGS = tuple(f"{segment}_{side}" for segment in ("thigh", "shin", "foot") for side in ("left", "right"))
"""Cameras on legs; each is named as its segment."""


@dataclass(frozen=True)
class Sight:
    """What is wrong with the cameras.

    Attributes:
        blind: cameras without images.
        dark: camera -> from and until when it has none [s].
        lost: camera -> from and until when it is not registered, and only its rotation is measured [s].
        blurred: the same, when its images are blurred.
    """

    blind: Collection[str] = ()
    dark: Mapping[str, Stretches] = field(default_factory=dict)
    lost: Mapping[str, Stretches] = field(default_factory=dict)
    blurred: Mapping[str, Stretches] = field(default_factory=dict)


_LANDING = AIRBORNE_S[1]
JUMPING = Sight(
    dark={"foot_right": ((1.0, 1.5), (1.7, 2.7))},
    lost={"shin_right": ((_LANDING - 0.05, _LANDING + 0.2),)},
    blurred={camera: ((_LANDING - 0.2, _LANDING + 0.2),) for camera in BODY.mounts},
)
"""The second foot is lost before the jump and through it, its shin at landing, and all is blurred."""


def frames(athlete: Athlete, sight: Sight, seed: int = 0) -> Iterator[BodyFrame]:
    """Registrations of all cameras, frame by frame."""
    random = np.random.default_rng(seed)
    body, nothing = athlete.body, np.zeros(0, np.uint32)
    rows = {camera: body.segment_index[mount.segment] for camera, mount in body.mounts.items()}
    cameras = {name: athlete.poses[:, rows[name]] @ mount.segment_T_camera for name, mount in body.mounts.items()}
    for instant, seconds in enumerate(athlete.times):
        matches = {}
        for camera, poses in cameras.items():
            noise, turn_noise = random.standard_normal(6), random.standard_normal(3)
            if camera in sight.blind or _within(sight.dark.get(camera, ()), seconds):
                continue
            sigmas = NOISE * (BLUR if _within(sight.blurred.get(camera, ()), seconds) else 1.0)
            turn = poses[instant, :3, :3].T @ poses[max(instant - 1, 0), :3, :3]
            matches[camera] = LandmarkMatches(
                camera=camera,
                stamp_ns=stamp_ns(instant),
                previous_stamp_ns=stamp_ns(instant - 1) if instant else 0,
                track_ids=nothing,
                landmark_ids=nothing,
                pixels=np.zeros((0, 2), np.float32),
                points_world=np.zeros((0, 3), np.float32),
                world_T_camera=None
                if _within(sight.lost.get(camera, ()), seconds)
                else poses[instant] @ exp_se3(sigmas * noise),
                pose_covariance=np.diag(sigmas**2),
                current_R_previous=turn @ exp_so3(TURN_NOISE_RAD * turn_noise),
                rotation_inliers=50 if instant else 0,
            )
        yield BodyFrame(stamp_ns(instant), matches)


def stamp_ns(instant: int) -> int:
    """Stamp of a frame, counted from 0 [ns]."""
    return START_NS + round(1e9 * instant / RATE_HZ)


def _within(stretches: Stretches, seconds: float) -> bool:
    return any(start <= seconds <= end for start, end in stretches)


@dataclass(frozen=True, eq=False)
class Solved:
    """Solved states, one a frame.

    Attributes:
        athlete: the truth.
        poses: (T, S, 4, 4) of the body's segments.
        equipment_poses: (T, E, 4, 4), none without equipment.
        lengths: what was unknown, name -> what it is and its sigma [m].
        reports: (T) what is published of the equipment, none without it.
    """

    athlete: Athlete
    poses: Array
    equipment_poses: Array
    lengths: Mapping[str, tuple[float, float]]
    reports: Sequence[EquipmentReport]

    @cached_property
    def position_errors(self) -> Array:
        """(T, S) distances of the segments' origins from the truth [m]."""
        errors: Array = np.linalg.norm((self.poses - self.athlete.poses)[..., :3, 3], axis=-1)
        return errors

    def engaged(self, name: str) -> NDArray[np.bool_]:
        """(T) whether an attachment was engaged."""
        return np.array([report.engaged[report.attachments.index(name)] for report in self.reports], bool)

    def deviations(self, name: str) -> Array:
        """(T) published distance between its points on body and equipment [m]."""
        return np.array([report.deviations[report.attachments.index(name)] for report in self.reports])

    def attachment_gaps(self, name: str, true_equipment: bool = False) -> Array:
        """(T) mean distance of an attachment's points on the body from where the equipment has them [m].

        Args:
            name: of the attachment, as the athlete's own description has it.
            true_equipment: as it truly is, not as solved.
        """
        athlete = self.athlete
        (attachment,) = (a for a in athlete.equipment.attachments if a.name == name)
        row = list(athlete.equipment.segments).index(attachment.equipment_segment)
        its = (athlete.equipment_poses if true_equipment else self.equipment_poses)[:, row]
        mine = self.poses[:, athlete.body.segment_index[attachment.body_segment]]
        return np.array([attachment.distances(a, b).mean() for a, b in zip(mine, its, strict=True)])


def solved(
    athlete: Athlete,
    sight: Sight,
    equipment: Equipment | None = None,
    seed: int = 0,
    settings: EstimatorSettings | None = None,
    live: bool = False,
) -> Solved:
    """Solve the frames, with equipment as it is described, or without."""
    body = coupled_body(athlete.body, equipment)
    coupling = Coupling(body, equipment, CouplingSettings(), MotionSettings()) if equipment else None
    estimator = BodyEstimator(body, lenses(athlete.body), settings, offline=not live, coupling=coupling)
    states = [state for frame in frames(athlete, sight, seed) for state in estimator.update(frame)]
    states += estimator.flush()
    assert [state.stamp_ns for state in states] == [stamp_ns(instant) for instant in range(len(athlete.times))]
    poses = np.stack([state.world_T_segment for state in states])
    count = len(athlete.body.segments)
    lengths = {}
    if coupling:
        last = states[-1].equipment
        assert last is not None
        lengths_now = (last.lengths, last.values, last.sigmas)
        lengths = {name: (float(value), float(sigma)) for name, value, sigma in zip(*lengths_now, strict=True)}
    reports = [state.equipment for state in states if state.equipment]
    return Solved(athlete, poses[:, :count], poses[:, count:], lengths, reports)


def leg_errors(done: Solved) -> Array:
    """(T, 6) of the joints of both legs [m]."""
    errors: Array = done.position_errors[:, [BODY.segment_index[segment] for segment in LEGS]]
    return errors


def boot_from_its_binding(done: Solved) -> Array:
    """(T) mean distance of the right boot's points from the binding of the board that the left boot carries [m]."""
    right = next(a for a in done.athlete.equipment.attachments if a.name == "binding_right")
    feet = [done.poses[:, BODY.segment_index[f"foot_{side}"]] for side in ("left", "right")]
    board = feet[0] @ inverse(binding("left"))
    return np.array([right.distances(a, b).mean() for a, b in zip(feet[1], board, strict=True)])
