"""A solved recording against the truth: all measures, per joint and overall.

T instants, S segments. The measures are those of A section 5.1, and two that mend what those cannot see: the absolute
scale, and rotations about a changing axis.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array, inverse, log_so3, nearest_rotation, rigid, umeyama
from bodycam_ros.results.solved_recording import SolvedRecording

ALTERNATIONS = 50
"""Steps of the alternating fit of constant frames; it has converged to rounding long before."""


@dataclass(frozen=True)
class Distribution:
    """Mean, median, 95th percentile and maximum; NaN of no values."""

    mean: float
    median: float
    p95: float
    max: float

    @classmethod
    def of(cls, values: NDArray[np.floating]) -> "Distribution":
        """The distribution of values of any shape; those that are NaN do not count."""
        known = values[np.isfinite(values)]
        if not known.size:
            return cls(np.nan, np.nan, np.nan, np.nan)
        return cls(float(known.mean()), float(np.median(known)), float(np.percentile(known, 95)), float(known.max()))


def spread(values: NDArray[np.floating]) -> dict[str, float]:
    """Mean, median, 95th percentile and maximum by name."""
    return asdict(Distribution.of(values))


def coverage(true_stamps_ns: NDArray[np.int64], solved_stamps_ns: NDArray[np.int64], frame_ns: float) -> float:
    """Share of the true frames (K,) that have a solved instant (T,) within half a frame."""
    return float(np.mean(distance_in_time(true_stamps_ns, solved_stamps_ns) <= frame_ns / 2.0))


def distance_in_time(stamps_ns: NDArray[np.int64], others_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) distance [ns] of each stamp (K,) to the nearest of others (T,), which increase."""
    after = np.searchsorted(others_ns, stamps_ns)
    next_one = others_ns[np.minimum(after, len(others_ns) - 1)]
    one_before = others_ns[np.maximum(after - 1, 0)]
    distance: NDArray[np.int64] = np.minimum(np.abs(next_one - stamps_ns), np.abs(stamps_ns - one_before))
    return distance


def alignment(estimated: Array, true: Array, with_scale: bool) -> tuple[float, Array, Array]:
    """Scale s, true_R_estimated (3, 3), t (3,) of a whole recording that bring s R estimated + t closest to true.

    A 5.1, "similarity transform from the SfM space to the motion capture space"; without scale if the map is metric.

    Args:
        estimated: (T, S, 3) positions of joints [m].
        true: (T, S, 3) the same joints [m].
    """
    return umeyama(estimated.reshape(-1, 3), true.reshape(-1, 3), with_scale)


def position_errors(estimated: Array, true: Array, scale: float, R: Array, t: Array) -> Array:
    """|s R estimated + t - true| (T, S) [m] of positions (T, S, 3) after an ``alignment`` (A figure 7b)."""
    errors: Array = np.linalg.norm(scale * estimated @ R.T + t - true, axis=-1)
    return errors


def tilt(true_R_estimated: Array) -> float:
    """Angle [rad] between the map's z axis and true up."""
    return float(np.arccos(np.clip(true_R_estimated[2, 2], -1.0, 1.0)))


def angle_errors(estimated: Array, true: Array) -> Array:
    """| |log(E_0' E_t)| - |log(T_0' T_t)| | (T,) [rad] of rotations of child in parent (T, 3, 3).

    A figure 7a: "the angle of the axis-angle representation normalized by the angle of the first frame". Blind to the
    axis, and at the mercy of the first frame: ``rotation_errors`` is neither.
    """
    errors: Array = np.abs(turned(estimated) - turned(true))
    return errors


def fit_constant_frames(estimated: Array, true: Array) -> tuple[Array, Array]:
    """Constant rotations A, B (3, 3) that bring A true_t B closest to estimated_t, in the chordal sense.

    Where one says that a segment's axes are is a convention: A is that of the parent, B that of the child. Alternating
    least squares: given one, the other is the mean of the rotations that remain.

    Args:
        estimated: (T, 3, 3) rotation of child in parent.
        true: (T, 3, 3) the same.
    """
    A, B = np.eye(3), np.eye(3)
    for _ in range(ALTERNATIONS):
        A = nearest_rotation(np.mean(estimated @ _transposed(true @ B), axis=0))
        B = nearest_rotation(np.mean(_transposed(A @ true) @ estimated, axis=0))
    return A, B


def rotation_errors(estimated: Array, true: Array, A: Array, B: Array) -> Array:
    """|log(A true_t B estimated_t')| (T,) [rad]: the geodesic error once constant frames are fitted."""
    return _angle(A @ true @ B @ _transposed(estimated))


def turned(rotations: Array) -> Array:
    """By how much (T,) [rad] rotations (T, 3, 3) have turned since the first (A figure 7a)."""
    return _angle(_transposed(rotations[:1]) @ rotations)


def _angle(R: Array) -> Array:
    angle: Array = np.linalg.norm(log_so3(R), axis=-1)
    return angle


def _transposed(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)


@dataclass(frozen=True, eq=False)
class JointRotation:
    """Rotations of a child segment in its parent over T instants.

    Attributes:
        estimated: (T, 3, 3).
        true: (T, 3, 3), brought to the frames of the estimate's segments.
        angle_errors: (T,) [rad] the paper's measure.
        rotation_errors: (T,) [rad] geodesic, with constant frames fitted.
    """

    estimated: Array
    true: Array
    angle_errors: Array
    rotation_errors: Array


@dataclass(frozen=True, eq=False)
class Comparison:
    """Estimate and truth at the T instants where both are known, for S segments.

    Attributes:
        truth_name: name of the recording that the truth belongs to.
        stamps_ns: (T,) [ns].
        segments: (S) names; a segment's origin is the joint to its parent.
        missing: segments of the truth that the URDF does not have.
        coverage: share of the true frames with a solved instant within half a frame.
        scale: of the truth over the estimate.
        tilt: between the map's z axis and true up [rad].
        position_errors: (T, S) [m], after one rigid alignment.
        similarity_errors: (T, S) [m], after one alignment with scale.
        joints: child segment -> its rotation in its parent.
        estimate_T_truth: (4, 4) pose of the true world in the map [m], by the rigid alignment.
        true_segments: (S, T, 4, 4) the truth in the map [m].
    """

    truth_name: str
    stamps_ns: NDArray[np.int64]
    segments: tuple[str, ...]
    missing: tuple[str, ...]
    coverage: float
    scale: float
    tilt: float
    position_errors: Array
    similarity_errors: Array
    joints: Mapping[str, JointRotation]
    true_segments: Array


def compare(solved: SolvedRecording, truth: TrueMotion) -> Comparison:
    """Measure a solved recording against the truth.

    Raises:
        RecordingError: the two share no time or too few segments.
    """
    inside = truth.covers(solved.stamps_ns)
    _check_overlap(solved, truth, inside)
    there = [s for s in sorted(truth.world_T_segment) if s in solved.world_T_link]
    segments = tuple(s for s in there if s in truth.parents or s == truth.root)
    stamps_ns = solved.stamps_ns[inside]
    estimated = {s: solved.world_T_link[s][inside] for s in segments}
    true = {s: truth.at(stamps_ns, s) for s in segments}
    try:
        errors = _PositionErrors(_origins(estimated), _origins(true))
    except ValueError as error:
        raise RecordingError(
            f"{solved.path} and {truth.path} share too little to be aligned: segments {', '.join(segments) or 'none'}, "
            f"{len(stamps_ns)} instants"
        ) from error
    return Comparison(
        truth_name=truth.recording,
        stamps_ns=stamps_ns,
        segments=segments,
        missing=tuple(s for s in sorted(truth.world_T_segment) if s not in there),
        coverage=coverage(truth.stamps_ns, solved.stamps_ns, truth.frame_ns),
        scale=errors.scale,
        tilt=tilt(errors.true_T_estimate[:3, :3]),
        position_errors=errors.rigid,
        similarity_errors=errors.similarity,
        joints={
            child: _joint_rotation(_child_in_parent(estimated, parent, child), _child_in_parent(true, parent, child))
            for child, parent in truth.parents.items()
            if child in segments and parent in segments
        },
        true_segments=inverse(errors.true_T_estimate) @ np.stack([true[s] for s in segments]),
    )


class _PositionErrors:
    """Position errors after one alignment of the whole recording, rigid and with scale."""

    def __init__(self, estimated: Array, true: Array) -> None:
        scale, R, t = alignment(estimated, true, with_scale=False)
        self.true_T_estimate = rigid(R, t)
        self.rigid = position_errors(estimated, true, scale, R, t)
        self.scale, R, t = alignment(estimated, true, with_scale=True)
        self.similarity = position_errors(estimated, true, self.scale, R, t)


def _check_overlap(solved: SolvedRecording, truth: TrueMotion, inside: NDArray[np.bool_]) -> None:
    if not inside.any():
        spans = [f"{1e-9 * s[0]:.3f} to {1e-9 * s[-1]:.3f} s" for s in (solved.stamps_ns, truth.stamps_ns)]
        raise RecordingError(
            f"{truth.path} is the truth of another recording: it spans {spans[1]}, {solved.path} spans {spans[0]}"
        )


def _origins(world_T_segment: Mapping[str, Array]) -> Array:
    """(T, S, 3) origins of segments' poses."""
    return np.stack([poses[:, :3, 3] for poses in world_T_segment.values()], axis=1)


def _child_in_parent(world_T_segment: Mapping[str, Array], parent: str, child: str) -> Array:
    world_R_parent, world_R_child = world_T_segment[parent][:, :3, :3], world_T_segment[child][:, :3, :3]
    parent_R_child: Array = np.swapaxes(world_R_parent, 1, 2) @ world_R_child
    return parent_R_child


def _joint_rotation(estimated: Array, true: Array) -> JointRotation:
    A, B = fit_constant_frames(estimated, true)
    return JointRotation(
        estimated=estimated,
        true=A @ true @ B,
        angle_errors=angle_errors(estimated, true),
        rotation_errors=rotation_errors(estimated, true, A, B),
    )
