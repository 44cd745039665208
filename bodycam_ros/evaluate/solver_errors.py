"""How far a solver's motion is from the truth: the measures of ``compare``, of poses that are no recording yet."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate import measures
from bodycam_ros.evaluate.health import jitter_of
from bodycam_ros.evaluate.solver_runs import SolverRun
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.geometry import Array, rigid


@dataclass(frozen=True, eq=False)
class SolverErrors:
    """Against the truth, at the T instants that it covers.

    Attributes:
        stamps_ns: (T,).
        positions: (T, S) errors of joints [m], after one rigid alignment.
        rotations: (T, J) errors of joint rotations [rad], once constant frames are fitted.
        jitter: (T, S) [m], see ``jitter_of``.
        estimated: segment -> (T, 4, 4) poses in the true world.
        angles: segment -> (T,) how far its joint has turned since the first instant [rad], A figure 7a.
        true_angles: the same of the truth.
    """

    stamps_ns: NDArray[np.int64]
    positions: Array
    rotations: Array
    jitter: Array
    estimated: Mapping[str, Array]
    angles: Mapping[str, Array]
    true_angles: Mapping[str, Array]


def solver_errors(run: SolverRun, body: BodyModel, truth: TrueMotion) -> SolverErrors:
    """Measure a run.

    Raises:
        RecordingError: the truth is of another recording or another body.
    """
    inside = truth.covers(run.stamps_ns)
    segments = [segment for segment in body.segments if segment in truth.world_T_segment]
    if not inside.any() or len(segments) < 2:
        raise RecordingError(f"{truth.path} is the truth of another recording, or of another body than {body.name}")
    stamps_ns = run.stamps_ns[inside]
    poses = {segment: run.world_T_segment[inside, body.segment_index[segment]] for segment in segments}
    true = {segment: truth.at(stamps_ns, segment) for segment in segments}
    origins, true_origins = (np.stack([p[:, :3, 3] for p in of.values()], axis=1) for of in (poses, true))
    scale, R, t = measures.alignment(origins, true_origins, with_scale=False)
    rotations, angles, true_angles = [], {}, {}
    for joint in body.tree_joints:
        if joint.parent in poses and joint.child in poses:
            ours, theirs = (_turn(of[joint.parent], of[joint.child]) for of in (poses, true))
            rotations.append(measures.rotation_errors(ours, theirs, *measures.fit_constant_frames(ours, theirs)))
            angles[joint.child], true_angles[joint.child] = measures.turned(ours), measures.turned(theirs)
    if not rotations:
        raise RecordingError(f"{truth.path}: no joint of body {body.name} has both of its segments in this truth")
    return SolverErrors(
        stamps_ns,
        measures.position_errors(origins, true_origins, scale, R, t),
        np.stack(rotations, axis=1),
        jitter_of(origins, stamps_ns, float(np.median(np.diff(stamps_ns)))),
        {segment: rigid(R, t) @ of_segment for segment, of_segment in poses.items()},
        angles,
        true_angles,
    )


def _turn(world_T_parent: Array, world_T_child: Array) -> Array:
    """Rotation (T, 3, 3) of a child in its parent."""
    parent_R_child: Array = np.swapaxes(world_T_parent[:, :3, :3], 1, 2) @ world_T_child[:, :3, :3]
    return parent_R_child
