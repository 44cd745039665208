"""The truth of a recording, and a solved recording against it, per joint and overall.

The measures are those of A section 5.1, and two that these lack: the absolute scale, and rotations about a changing
axis.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.anatomical_angles import AngleAgreement, compare_rotations
from bodycam_ros.evaluate.figures import SegmentErrors, TruthFigures, spread
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.formats.tum import read_tum
from bodycam_ros.geometry import Array, inverse, rigid, umeyama
from bodycam_ros.results.body_motion import distance_in_time, interpolated
from bodycam_ros.results.solved_recording import SolvedRecording

_TRUTH = "truth"
_EDGE_NS = 1000
"""A stamp this far outside counts as the first or the last frame's: stamps are rounded on their way."""


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """True poses of the segments over K frames.

    Attributes:
        path: of the folder that holds them.
        stamps_ns: (K,) increasing [ns].
        parents: segment -> its parent, None of the root; of segments that carry a camera or lie between such.
        world_T_segment: segment -> (K, 4, 4) [m], z up; may hold more segments, such as hands.
    """

    path: Path
    stamps_ns: NDArray[np.int64]
    parents: Mapping[str, str | None]
    world_T_segment: Mapping[str, Array]

    def at(self, stamps_ns: NDArray[np.int64], segment: str) -> Array:
        """Poses (T, 4, 4) of a segment at stamps (T,) that the truth covers [ns]."""
        return interpolated(self.stamps_ns, self.world_T_segment[segment], stamps_ns)


def read_true_motion(path: Path) -> TrueMotion:
    """Read ``truth/segments/*.tum`` of a recording and the tree of segments in its ``rig.yaml``.

    Args:
        path: the recording's folder, or its folder ``truth``.

    Raises:
        RecordingError: a folder or file is missing or malformed.
    """
    truth = path / _TRUTH if (path / _TRUTH).is_dir() else path
    files = sorted((truth / "segments").glob("*.tum"))
    if not files:
        raise RecordingError(f"{path}: no ground truth; expected segments/*.tum in it or in its folder truth")
    parents = _read_parents(truth)
    trajectories = {file.stem: read_tum(file) for file in files}
    if not set(parents) & set(trajectories):
        raise RecordingError(f"{truth / 'segments'}: none of its files is named as a segment of rig.yaml")
    stamps_ns = next(iter(trajectories.values()))[0]
    for segment, (stamps, _) in trajectories.items():
        if not np.array_equal(stamps, stamps_ns):
            raise RecordingError(f"{truth / 'segments'}: {segment}.tum has other stamps than the first file")
    return TrueMotion(truth, stamps_ns, parents, {segment: poses for segment, (_, poses) in trajectories.items()})


def _read_parents(truth: Path) -> dict[str, str | None]:
    """Segment -> its parent, None of the one at the root."""
    places = [folder / "rig.yaml" for folder in (truth, truth.resolve().parent)]
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        raise RecordingError(f"{truth}: no rig.yaml in it or beside it, with the parent of each segment")
    document = read_yaml(path, "rig file", RecordingError)
    try:
        parents = {str(segment): str(parent) if parent else None for segment, parent in document["segments"].items()}
    except (KeyError, TypeError, AttributeError) as error:
        raise RecordingError(f"{path}: expected a table segments, segment -> parent") from error
    roots = [segment for segment, parent in parents.items() if parent is None]
    if len(roots) != 1:
        raise RecordingError(f"{path}: one segment has no parent (null), not {len(roots)}: {', '.join(roots)}")
    return parents


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

    def figures(self) -> TruthFigures:
        """The errors in figures."""
        degrees, cm = np.degrees(1.0), 100.0
        errors = {
            "position_cm": dict(zip(self.segments, cm * self.position_errors.T, strict=True)),
            "angle_deg": {segment: degrees * joint.turn_errors for segment, joint in self.joints.items()},
            "rotation_deg": {segment: degrees * errors for segment, errors in self.rotation_errors.items()},
        }
        per_joint = {
            segment: SegmentErrors(**{name: spread(each[segment]) for name, each in errors.items() if segment in each})
            for segment in self.segments
        }
        return TruthFigures(
            frames=len(self.stamps_ns),
            coverage=self.coverage,
            joints=len(self.segments),
            links_missing=list(self.missing),
            position_cm=spread(self.position_errors, cm),
            sim_position_cm=spread(self.similarity_errors, cm),
            scale=self.scale,
            tilt_deg=degrees * self.tilt,
            angle_deg=spread(np.array([*errors["angle_deg"].values()])),
            rotation_deg=spread(np.array([*errors["rotation_deg"].values()])),
            per_joint=per_joint,
        )


def compare(solved: SolvedRecording, truth: TrueMotion) -> Comparison:
    """Measure a solved recording against the truth.

    Raises:
        RecordingError: the two share no time or too few segments.
    """
    first_ns, last_ns = truth.stamps_ns[[0, -1]] + [-_EDGE_NS, _EDGE_NS]
    inside = (solved.stamps_ns >= first_ns) & (solved.stamps_ns <= last_ns)
    if not inside.any():
        spans = [f"{1e-9 * s[0]:.3f} to {1e-9 * s[-1]:.3f} s" for s in (solved.stamps_ns, truth.stamps_ns)]
        raise RecordingError(
            f"{truth.path} is the truth of another recording: it spans {spans[1]}, {solved.path} spans {spans[0]}; "
            f"if only the clocks differ, as after 'bodycam ingest', give --truth {truth.path / 'segments'}: its clock "
            "offset is then estimated from the motion"
        )
    known = [s for s in sorted(truth.world_T_segment) if s in solved.body.segments]
    segments = tuple(s for s in known if s in truth.parents)
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
    near_ns, folder = distance_in_time(truth.stamps_ns, solved.stamps_ns), truth.path.resolve()
    return Comparison(
        truth_name=folder.parent.name if folder.name == _TRUTH else folder.name,
        stamps_ns=stamps_ns,
        segments=segments,
        missing=tuple(s for s in sorted(truth.world_T_segment) if s not in known),
        coverage=float(np.mean(near_ns <= np.median(np.diff(truth.stamps_ns)) / 2.0)),
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
