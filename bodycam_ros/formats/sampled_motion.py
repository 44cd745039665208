"""A solved motion at the instants that a file wants: those that were solved, or evenly spaced ones.

Between two solved instants every joint turns about one axis at constant speed (on SO(3), by logarithm and exponential),
the root likewise, and places go straight, so bones keep their lengths. Nothing is extrapolated: the first instant is
the first that was solved, and the last lies before the last that was. Where instants were left out, more than one and a
half steps apart, there is a gap: its instants are marked as unknown, and interpolated all the same for formats that
cannot say so.
"""

import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.body_motion import between_neighbours, interpolated
from bodycam_ros.results.solved_body import SolvedBody, plain_name
from bodycam_ros.results.solved_recording import GAP_FRAMES

logger = logging.getLogger(__name__)

_SAME_NS = 1_000  # instants this near are one: stamps are rounded
_MOST_INSTANTS = 500_000  # four hours at 30 a second: two gigabytes while it is written


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """A body over T instants.

    Attributes:
        name: of the recording.
        body: what moves, with the equipment beside it.
        stamps_ns: (T,) increasing [ns].
        known: (T,) whether it was solved there, or between instants without a gap.
        placed: (T,) whether it is known where equipment is.
        rate: instants a second; None if they are as they were solved.
        world_T_root: (T, 4, 4) [m].
        joint_poses: (T, J, 4, 4) in the order of ``BodyModel.tree_joints``, as ``forward_kinematics`` wants them.
        angles: (T, A) joint angles, continuous [rad]; places of free joints [m].
    """

    name: str
    body: BodyModel
    stamps_ns: NDArray[np.int64]
    known: NDArray[np.bool_]
    placed: NDArray[np.bool_]
    rate: float | None
    world_T_root: Array
    joint_poses: Array
    angles: Array

    @cached_property
    def world_T_segment(self) -> Array:
        """(T, S, 4, 4) poses of all segments [m]."""
        return self.body.forward_kinematics(self.world_T_root, self.joint_poses)

    @cached_property
    def angle_names(self) -> tuple[str, ...]:
        """(A) in the order of ``angles``."""
        return JointAngles(self.body).names

    @property
    def seconds(self) -> Array:
        """(T,) since the first instant [s]."""
        return np.asarray((self.stamps_ns - self.stamps_ns[0]) * 1e-9, dtype=np.float64)

    @cached_property
    def people(self) -> tuple[str, ...]:
        """Segments of the body alone, without equipment, each after the one that it hangs on."""
        ordered = [self.body.root, *(joint.child for joint in self.body.tree_joints)]
        return tuple(segment for segment in ordered if segment not in self.body.equipment_segments)

    @cached_property
    def parents(self) -> dict[str, str]:
        """Segment -> the one that it hangs on; the root has none."""
        return {joint.child: joint.parent for joint in self.body.tree_joints}

    def poses_of(self, segment: str) -> Array:
        """(T, 4, 4) poses world_T_segment of one segment [m]."""
        poses: Array = self.world_T_segment[:, self.body.segment_index[segment]]
        return poses

    def knows(self, segment: str) -> NDArray[np.bool_]:
        """(T,) whether it is known where a segment is."""
        beside = segment in self.body.equipment_segments
        return self.known & self.placed if beside else self.known


def sampled(solved: SolvedBody, rate: float | None, even: bool) -> SampledMotion:
    """The motion of a solved bag at the instants that a file wants.

    Args:
        solved: of the bag.
        rate: instants a second; None: its own.
        even: the file says a rate and no times, so instants must be evenly spaced.

    Raises:
        RecordingError: fewer than two instants were solved, or would be written; or too many would be.
    """
    motion, body = solved.motion, solved.body
    stamps = motion.stamps_ns
    if len(stamps) < 2:
        raise RecordingError(f"{solved.path}: only one instant was solved; a motion has two at least")
    joint_angles = JointAngles(body)
    joint_poses = joint_angles.poses(motion.joint_angles)
    step_ns = _own_step_ns(stamps)
    longest_ns = GAP_FRAMES * step_ns
    _tell_gaps(solved, longest_ns)
    if rate is None and not even:
        everywhere = np.ones(len(stamps), bool)
        return SampledMotion(
            _name(solved), body, stamps, everywhere, solved.placed, None, motion.world_T_root, joint_poses,
            motion.joint_angles,
        )  # fmt: skip
    at_ns = _even_stamps(solved, 1e9 / rate if rate else step_ns)
    nearest = _nearest(stamps, at_ns)
    joints = [interpolated(stamps, joint_poses[:, row], at_ns) for row in range(joint_poses.shape[1])]
    poses = np.stack(joints, axis=1) if joints else np.zeros((len(at_ns), 0, 4, 4))
    return SampledMotion(
        name=_name(solved),
        body=body,
        stamps_ns=at_ns,
        known=between_neighbours(stamps, at_ns, longest_ns) | np.isin(at_ns, stamps),
        placed=_on_both_sides(solved.placed, stamps, at_ns),
        rate=rate or 1e9 / step_ns,
        world_T_root=interpolated(stamps, motion.world_T_root, at_ns),
        joint_poses=poses,
        angles=joint_angles.angles(poses, motion.joint_angles[nearest]),
    )


def _own_step_ns(stamps: NDArray[np.int64]) -> float:
    """Time between two instants where none is left out, as the whole recording has it [ns]."""
    steps = np.diff(stamps)
    neighbours = steps[steps <= GAP_FRAMES * np.median(steps)]
    return float(neighbours.mean())


def _even_stamps(solved: SolvedBody, step_ns: float) -> NDArray[np.int64]:
    """(T,) from the first solved instant on; those that fall on a solved one are it."""
    stamps = solved.motion.stamps_ns
    count = int((stamps[-1] - stamps[0] + _SAME_NS) / step_ns) + 1
    if count < 2:
        raise RecordingError(
            f"{solved.path}: lasts {1e-9 * (stamps[-1] - stamps[0]):.2f} s, too short for a second frame "
            f"{1e-9 * step_ns:.3g} s after the first; choose a higher --rate"
        )
    if count > _MOST_INSTANTS:
        raise RecordingError(
            f"{solved.path}: {count} instants would be written, more than {_MOST_INSTANTS}; choose a lower --rate"
        )
    at_ns = stamps[0] + np.round(np.arange(count) * step_ns).astype(np.int64)
    nearest = stamps[_nearest(stamps, at_ns)]
    even: NDArray[np.int64] = np.where(np.abs(nearest - at_ns) <= _SAME_NS, nearest, at_ns)
    return even


def _on_both_sides(placed: NDArray[np.bool_], stamps: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(T,) whether so said of both solved instants around each; of a solved one itself."""
    before, after = np.searchsorted(stamps, at_ns, side="right") - 1, np.searchsorted(stamps, at_ns, side="left")
    both: NDArray[np.bool_] = placed[before] & placed[after]
    return both


def _nearest(stamps: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    after = np.clip(np.searchsorted(stamps, at_ns), 1, len(stamps) - 1)
    return np.where(at_ns - stamps[after - 1] < stamps[after] - at_ns, after - 1, after)


def _tell_gaps(solved: SolvedBody, longest_ns: float) -> None:
    stamps = solved.motion.stamps_ns
    steps = np.diff(stamps)
    gaps = np.flatnonzero(steps > longest_ns)
    if not len(gaps):
        return
    worst = gaps[np.argmax(steps[gaps])]
    logger.warning(
        "%s: %d gap%s without solved instants, %.2f s together, the longest of %.2f s at %.2f s: left empty by formats "
        "that can say so, crossed straight by others",
        solved.path,
        len(gaps),
        "" if len(gaps) == 1 else "s",
        1e-9 * steps[gaps].sum(),
        1e-9 * steps[worst],
        1e-9 * (stamps[worst] - stamps[0]),
    )


def _name(solved: SolvedBody) -> str:
    """Of the recording, in one word: it stands in headers that go by lines and columns."""
    return "_".join(plain_name(solved.path).split())
