"""A solved recording against the truth: all measures, per joint and overall."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate import measures
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array, inverse, rigid
from bodycam_ros.solved.solved_recording import SolvedRecording


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
        coverage=measures.coverage(truth.stamps_ns, solved.stamps_ns, truth.frame_ns),
        scale=errors.scale,
        tilt=measures.tilt(errors.true_T_estimate[:3, :3]),
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
        scale, R, t = measures.alignment(estimated, true, with_scale=False)
        self.true_T_estimate = rigid(R, t)
        self.rigid = measures.position_errors(estimated, true, scale, R, t)
        self.scale, R, t = measures.alignment(estimated, true, with_scale=True)
        self.similarity = measures.position_errors(estimated, true, self.scale, R, t)


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
    A, B = measures.fit_constant_frames(estimated, true)
    return JointRotation(
        estimated=estimated,
        true=A @ true @ B,
        angle_errors=measures.angle_errors(estimated, true),
        rotation_errors=measures.rotation_errors(estimated, true, A, B),
    )
