"""A solved recording against the truth, per joint and overall.

The measures are those of A section 5.1, and two that these lack: the absolute scale, and rotations about a changing
axis.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array, inverse, log_so3, nearest_rotation, rigid, umeyama
from bodycam_ros.results.solved_recording import SolvedRecording

_ALTERNATIONS = 50  # of the fit of constant frames; it has converged to rounding long before


def spread(values: NDArray[np.floating], factor: float = 1.0) -> dict[str, float]:
    """Mean, median, 95th percentile and maximum of values of any shape, times a factor; NaN ones do not count."""
    known = factor * values[np.isfinite(values)]
    if not known.size:
        return dict.fromkeys(("mean", "median", "p95", "max"), np.nan)
    statistics = (known.mean(), np.median(known), np.percentile(known, 95), known.max())
    return dict(zip(("mean", "median", "p95", "max"), map(float, statistics), strict=True))


def distance_in_time(stamps_ns: NDArray[np.int64], others_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) distance [ns] of each stamp (K,) to the nearest of others (T,), which increase."""
    after = np.searchsorted(others_ns, stamps_ns)
    next_one = others_ns[np.minimum(after, len(others_ns) - 1)]
    one_before = others_ns[np.maximum(after - 1, 0)]
    distance: NDArray[np.int64] = np.minimum(np.abs(next_one - stamps_ns), np.abs(stamps_ns - one_before))
    return distance


def fit_constant_frames(estimated: Array, true: Array) -> tuple[Array, Array]:
    """Constant rotations A, B (3, 3) that bring A true_t B closest to estimated_t, in the chordal sense.

    The axes of a segment are a convention: A is that of the parent, B that of the child. Alternating least squares:
    given one, the other is the mean of the rotations that remain.

    Args:
        estimated: (T, 3, 3) rotation of child in parent.
        true: (T, 3, 3) the same.
    """
    A, B = np.eye(3), np.eye(3)
    for _ in range(_ALTERNATIONS):
        A = nearest_rotation(np.mean(estimated @ _transposed(true @ B), axis=0))
        B = nearest_rotation(np.mean(_transposed(A @ true) @ estimated, axis=0))
    return A, B


def turned(rotations: Array) -> Array:
    """Angle (T,) [rad] between rotations (T, 3, 3) and the first of them (A figure 7a)."""
    return angle_between(rotations[:1], rotations)


def angle_between(first: Array, second: Array) -> Array:
    """(T,) geodesic angle [rad] between rotations (T, 3, 3)."""
    angle: Array = np.linalg.norm(log_so3(_transposed(first) @ second), axis=-1)
    return angle


def _transposed(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)


@dataclass(frozen=True, eq=False)
class JointRotation:
    """Rotation of a child segment in its parent over T states.

    Attributes:
        true: (T, 3, 3), in the frames of the estimate's segments.
        angle_errors: (T,) [rad] | |log(E_0' E_t)| - |log(T_0' T_t)| | (A figure 7a): blind to the axis, and wrong as a
            whole if the first frame is.
        rotation_errors: (T,) [rad] geodesic, with constant frames fitted.
    """

    true: Array
    angle_errors: Array
    rotation_errors: Array


@dataclass(frozen=True, eq=False)
class Comparison:
    """Estimate and truth at the T states where both are known, for S segments.

    Attributes:
        truth_name: name of the recording that the truth belongs to.
        stamps_ns: (T,) [ns].
        segments: (S) names; a segment's origin is the joint to its parent.
        missing: segments of the truth that the body does not have.
        coverage: share of the true frames with a solved state within half a frame.
        scale: of the truth over the estimate.
        tilt: between the map's z axis and true up [rad].
        position_errors: (T, S) [m], after one rigid alignment of the whole recording (A figure 7b).
        similarity_errors: (T, S) [m], after one alignment with scale (A 5.1).
        joints: child segment -> its rotation in its parent.
        true_segments: segment -> (T, 4, 4) the truth in the map [m], by the rigid alignment.
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
    true_segments: Mapping[str, Array]

    def figures(self) -> dict[str, Any]:
        """Figures by name, the unit at the end of the name."""
        degrees, cm = np.degrees(1.0), 100.0
        angles = {segment: degrees * joint.angle_errors for segment, joint in self.joints.items()}
        rotations = {segment: degrees * joint.rotation_errors for segment, joint in self.joints.items()}
        per_joint = {
            segment: {"position_cm": float(errors.mean())}
            for segment, errors in zip(self.segments, cm * self.position_errors.T, strict=True)
        }
        for segment in self.joints:
            per_joint[segment]["angle_deg"] = float(angles[segment].mean())
            per_joint[segment]["rotation_deg"] = float(rotations[segment].mean())
        return {
            "frames": len(self.stamps_ns),
            "coverage": self.coverage,
            "joints": len(self.segments),
            "links_missing": list(self.missing),
            "position_cm": spread(self.position_errors, cm),
            "sim_position_cm": spread(self.similarity_errors, cm),
            "scale": self.scale,
            "tilt_deg": degrees * self.tilt,
            "angle_deg": spread(np.array(list(angles.values()))),
            "rotation_deg": spread(np.array(list(rotations.values()))),
            "per_joint": per_joint,
        }


def compare(solved: SolvedRecording, truth: TrueMotion) -> Comparison:
    """Measure a solved recording against the truth.

    Raises:
        RecordingError: the two share no time or too few segments.
    """
    inside = truth.covers(solved.stamps_ns)
    if not inside.any():
        spans = [f"{1e-9 * s[0]:.3f} to {1e-9 * s[-1]:.3f} s" for s in (solved.stamps_ns, truth.stamps_ns)]
        raise RecordingError(
            f"{truth.path} is the truth of another recording: it spans {spans[1]}, {solved.path} spans {spans[0]}; "
            f"where only the clocks differ, as of ingested files, give --truth {truth.path / 'segments'}, which "
            "is placed by its motion"
        )
    known = [s for s in sorted(truth.world_T_segment) if s in solved.body.segments]
    segments = tuple(s for s in known if s in truth.parents or s == truth.root)
    stamps_ns = solved.stamps_ns[inside]
    estimated = {s: solved.world_T_link[s][inside] for s in segments}
    true = {s: truth.at(stamps_ns, s) for s in segments}
    try:
        ours, theirs = (np.stack([poses[:, :3, 3] for poses in each.values()], axis=1) for each in (estimated, true))
        _, R, t = umeyama(ours.reshape(-1, 3), theirs.reshape(-1, 3), False)
        scale, similar_R, similar_t = umeyama(ours.reshape(-1, 3), theirs.reshape(-1, 3), True)
    except ValueError as error:
        raise RecordingError(
            f"{solved.path} and {truth.path} share too little to be aligned: segments {', '.join(segments) or 'none'}, "
            f"{len(stamps_ns)} states"
        ) from error
    near_ns = distance_in_time(truth.stamps_ns, solved.stamps_ns)
    return Comparison(
        truth_name=truth.recording,
        stamps_ns=stamps_ns,
        segments=segments,
        missing=tuple(s for s in sorted(truth.world_T_segment) if s not in known),
        coverage=float(np.mean(near_ns <= truth.frame_ns / 2.0)),
        scale=scale,
        tilt=float(np.arccos(np.clip(R[2, 2], -1.0, 1.0))),
        position_errors=np.linalg.norm(ours @ R.T + t - theirs, axis=-1),
        similarity_errors=np.linalg.norm(scale * ours @ similar_R.T + similar_t - theirs, axis=-1),
        joints={
            child: _joint_rotation(*(inverse(each[parent]) @ each[child] for each in (estimated, true)))
            for child, parent in truth.parents.items()
            if child in segments and parent in segments
        },
        true_segments={s: inverse(rigid(R, t)) @ poses for s, poses in true.items()},
    )


def _joint_rotation(parent_T_child: Array, true_parent_T_child: Array) -> JointRotation:
    estimated, true = parent_T_child[:, :3, :3], true_parent_T_child[:, :3, :3]
    A, B = fit_constant_frames(estimated, true)
    fitted = A @ true @ B
    return JointRotation(
        true=fitted,
        angle_errors=np.abs(turned(estimated) - turned(true)),
        rotation_errors=angle_between(fitted, estimated),
    )
