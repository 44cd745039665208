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
from bodycam_ros.evaluate.anatomical_angles import AngleAgreement, compare_rotations
from bodycam_ros.evaluate.spread import distance_in_time, spread
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array, inverse, rigid, umeyama
from bodycam_ros.results.solved_recording import SolvedRecording


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
    joints: Mapping[str, AngleAgreement]
    true_segments: Mapping[str, Array]

    @property
    def rotation_errors(self) -> Mapping[str, Array]:
        """Child segment -> (T,) [rad] geodesic errors of its rotation in its parent."""
        return {s: joint.rotation_errors for s, joint in self.joints.items() if joint.rotation_errors is not None}

    def figures(self) -> dict[str, Any]:
        """Figures by name, the unit at the end of the name."""
        degrees, cm = np.degrees(1.0), 100.0
        angles = {segment: degrees * joint.turn_errors for segment, joint in self.joints.items()}
        rotations = {segment: degrees * errors for segment, errors in self.rotation_errors.items()}
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
            child: compare_rotations(
                child,
                *((inverse(each[parent]) @ each[child])[:, :3, :3] for each in (estimated, true)),
                shares_axes=True,
            )
            for child, parent in truth.parents.items()
            if child in segments and parent in segments
        },
        true_segments={s: inverse(rigid(R, t)) @ poses for s, poses in true.items()},
    )
