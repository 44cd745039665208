"""A solved motion at the frames of a file: those that were solved, or evenly spaced ones.

Between two solved frames every joint rotates about one axis at constant speed (on SO(3), by logarithm and exponential),
the root likewise, and positions are linear, so bones keep their lengths. Nothing is extrapolated: the first frame is
the first that was solved, and the last lies before the last that was. Where frames are missing, more than one and a
half steps apart, there is a gap: its frames are marked as unknown, and interpolated for formats without missing values.
"""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError, SettingsError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.body_motion import between_neighbours, interpolated, nearest_rows
from bodycam_ros.results.solved_body import GAP_FRAMES, SolvedBody, plain_name

logger = logging.getLogger(__name__)

MAX_RATE = 1000.0  # [1/s] beyond it a minute fills gigabytes, and no person moves so fast
_MAX_SCALE = 1e6
_MAX_MASS_KG = 1000.0
_SAME_NS = 1_000  # stamps this close are one: they are rounded
_MAX_FRAMES = 500_000  # four hours at 30 a second: two gigabytes while it is written

UP_AXES: Mapping[str, Array] = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
}
"""Axis that is up in a program -> program_R_world (3, 3); ours are REP-103's: x forward, y left, z up."""


@dataclass(frozen=True)
class MotionOptions:
    """How a body and its motion are written; None: the format's own default.

    Attributes:
        rate: frames a second; None: those that were solved.
        pose: rest pose, a key of ``figure.REST_POSES``.
        up: axis that is up, a key of ``UP_AXES``.
        scale: units of the file to a metre.
        names: of the bones, a key of ``figure.BONE_NAMES``.
        segment: segment or camera whose trajectory is written, or "all".
        mass: of the whole person [kg].
        character: GLB or VRM of a rigged character that moves instead of the body.
        bones: YAML with the names of its bones.
        surface: folder with scanned meshes of segments, which are the skin.
        environment: place that was not there, as ``Environment.parse`` takes it.
        travel: speed that is added to the motion there [m/s].

    Raises:
        SettingsError: a value out of its range.
    """

    rate: float | None = None
    pose: str | None = None
    up: str | None = None
    scale: float | None = None
    names: str | None = None
    segment: str | None = None
    mass: float | None = None
    character: Path | None = None
    bones: Path | None = None
    surface: Path | None = None
    environment: str | None = None
    travel: float | None = None

    def __post_init__(self) -> None:
        for name, value, largest, unit in (
            ("rate", self.rate, MAX_RATE, " a second"),
            ("scale", self.scale, _MAX_SCALE, ""),
            ("mass", self.mass, _MAX_MASS_KG, " kg"),
        ):
            if value is not None and not (math.isfinite(value) and 0.0 < value <= largest):
                raise SettingsError(f"--{name} must be above 0 and at most {largest:g}{unit}, not {value:g}")

    @property
    def given(self) -> tuple[str, ...]:
        """Names of those that the user gave."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name) is not None)


@dataclass(frozen=True, eq=False)
class SampledMotion(SolvedBody):
    """A solved body over the T frames of a file, its angles continuous.

    Attributes:
        known: (T,) whether the frame was solved, or lies between solved frames without a gap.
        equipment_known: (T,) whether the pose of equipment is known, too.
        rate: frames a second, on average if they are as they were solved.
    """

    known: NDArray[np.bool_]
    equipment_known: NDArray[np.bool_]
    rate: float

    @property
    def name(self) -> str:
        """Name of the recording, in one word: headers go by lines and columns."""
        return "_".join(plain_name(self.path).split())

    @property
    def seconds(self) -> Array:
        """(T,) since the first frame [s]."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)

    @cached_property
    def body_segments(self) -> tuple[str, ...]:
        """Segments of the body alone, without equipment, parents first."""
        ordered = [self.body.root, *(joint.child for joint in self.body.tree_joints)]
        return tuple(segment for segment in ordered if segment not in self.body.equipment_segments)

    def segment_poses(self, segment: str) -> Array:
        """(T, 4, 4) poses world_T_segment of one segment [m]."""
        poses: Array = self.world_T_segment[:, self.body.segment_index[segment]]
        return poses

    def known_frames(self, segment: str) -> NDArray[np.bool_]:
        """(T,) whether a segment's pose is known."""
        return self.equipment_known if segment in self.body.equipment_segments else self.known


def sample_motion(solved: SolvedBody, rate: float | None, even: bool) -> SampledMotion:
    """The motion of a solved bag at the frames of a file.

    Args:
        solved: of the bag.
        rate: frames a second; None: its own.
        even: the file has a rate and no times, so frames must be evenly spaced.

    Raises:
        RecordingError: fewer than two frames were solved, or would be written; or too many would be.
    """
    frames, stamps = solved, solved.stamps_ns
    if len(stamps) < 2:
        raise RecordingError(f"{solved.path}: only one frame was solved; a motion has two or more")
    steps = np.diff(stamps)
    step_ns = float(steps[steps <= GAP_FRAMES * np.median(steps)].mean())
    _warn_of_gaps(solved, GAP_FRAMES * step_ns)
    as_solved = rate is None and not even
    at_ns = stamps if as_solved else _even_stamps(solved, 1e9 / rate if rate else step_ns)
    if not as_solved:
        angles = JointAngles(solved.body)
        poses = angles.poses(solved.joint_angles)
        between = [interpolated(stamps, poses[:, row], at_ns) for row in range(poses.shape[1])]
        joints = np.stack(between, axis=1) if between else np.zeros((len(at_ns), 0, 4, 4))
        frames = replace(
            solved,
            stamps_ns=at_ns,
            joint_angles=angles.angles(joints, solved.joint_angles[nearest_rows(stamps, at_ns)]),
            world_T_root=interpolated(stamps, solved.world_T_root, at_ns),
            root_covariance=solved.root_covariance[nearest_rows(stamps, at_ns)],
        )
    before, after = np.searchsorted(stamps, at_ns, side="right") - 1, np.searchsorted(stamps, at_ns, side="left")
    known = between_neighbours(stamps, at_ns, GAP_FRAMES * step_ns) | np.isin(at_ns, stamps)
    equipment_known = known & solved.placed[before] & solved.placed[after]
    states = {each.name: getattr(frames, each.name) for each in fields(SolvedBody)}
    return SampledMotion(**states, known=known, equipment_known=equipment_known, rate=rate or 1e9 / step_ns)


def change_axes(program_R_world: Array, rotations: Array) -> Array:
    """Rotations (..., 3, 3) as they are about a program's axes."""
    changed: Array = program_R_world @ rotations @ program_R_world.T
    return changed


def _even_stamps(solved: SolvedBody, step_ns: float) -> NDArray[np.int64]:
    """(T,) from the first solved frame on; those within rounding of a solved one are it."""
    stamps = solved.stamps_ns
    count = int((stamps[-1] - stamps[0] + _SAME_NS) / step_ns) + 1
    if count < 2:
        raise RecordingError(
            f"{solved.path}: lasts {1e-9 * (stamps[-1] - stamps[0]):.2f} s, too short for a second frame "
            f"{1e-9 * step_ns:.3g} s after the first; choose a higher --rate"
        )
    if count > _MAX_FRAMES:
        raise RecordingError(f"{solved.path}: {count} frames are more than {_MAX_FRAMES}; choose a lower --rate")
    at_ns = stamps[0] + np.round(np.arange(count) * step_ns).astype(np.int64)
    nearest = stamps[nearest_rows(stamps, at_ns)]
    even: NDArray[np.int64] = np.where(np.abs(nearest - at_ns) <= _SAME_NS, nearest, at_ns)
    return even


def _warn_of_gaps(solved: SolvedBody, longest_ns: float) -> None:
    stamps = solved.stamps_ns
    steps = np.diff(stamps)
    gaps = np.flatnonzero(steps > longest_ns)
    if not len(gaps):
        return
    worst = gaps[np.argmax(steps[gaps])]
    logger.warning(
        "%s: %d gap%s without solved frames, %.2f s in total, the longest of %.2f s at %.2f s: left empty by formats "
        "with missing values, interpolated by others",
        solved.path,
        len(gaps),
        "" if len(gaps) == 1 else "s",
        1e-9 * steps[gaps].sum(),
        1e-9 * steps[worst],
        1e-9 * (stamps[worst] - stamps[0]),
    )
