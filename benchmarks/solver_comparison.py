"""The same registrations, solved in several ways, against the truth: python -m benchmarks.solver_comparison RECORDING.

RECORDING is a folder with ``bag`` and ``truth``. Each way is solved twice: as recorded, and with a quarter of the
cameras dark in turn. Errors are those of joints after one rigid alignment, and of joint rotations once constant frames
are fitted; latency is the wait for later frames at the recorded rate, and the solver's time.
"""

import argparse
import ctypes
import gc
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.endurance import memory_bytes
from benchmarks.registrations import registrations
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.smoother_settings import OFFLINE
from bodycam_ros.evaluate import measures
from bodycam_ros.evaluate.health import jitter_of
from bodycam_ros.evaluate.true_motion import TrueMotion, read_true_motion
from bodycam_ros.geometry import Array
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches

WAYS: Mapping[str, Mapping[str, object]] = {
    "window, LM": {"incremental": False},
    "iSAM2 + 0": {"output_delay": 0},
    "iSAM2 + 2": {"output_delay": 2},
    "iSAM2 + 4": {"output_delay": 4},
    "offline": {"output_delay": OFFLINE},
}
"""Way -> settings of ``smoother``; LM is Levenberg-Marquardt in the sliding window of paper A."""

DARK_ONE_OF = 4
"""One of so many cameras is dark at a time."""


@dataclass(frozen=True, eq=False)
class SolverRun:
    """Result of one way.

    Attributes:
        stamps_ns: (T,) of the states.
        world_T_segment: (T, S, 4, 4) poses, in the order of the body's segments.
        solve_ms: (T,) milliseconds of CPU of a state, time synchronisation included; offline each has its share.
        latency_ms: from an image to its state, by waiting and solving; infinite offline.
        memory_mb: by which the process grew at most.
    """

    stamps_ns: NDArray[np.int64]
    world_T_segment: Array
    solve_ms: Array
    latency_ms: float
    memory_mb: float


@dataclass(frozen=True, eq=False)
class SolverErrors:
    """Errors at the T states that the truth covers.

    Attributes:
        positions: (T, S) of joints [m].
        rotations: (T, J) of joint rotations [rad].
        jitter: (T, S) [m], see ``jitter_of``.
    """

    positions: Array
    rotations: Array
    jitter: Array


def run_solver(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: Sequence[LandmarkMatches],
    settings: PipelineSettings,
) -> SolverRun:
    """Solve registrations, in order of time, with ``settings.smoother``."""
    before = _memory_after_collection()
    skeleton = SkeletonPipeline(body, cameras, settings, live=False)
    states, spent_s, pending_s = [], [], 0.0
    for matches in [*registered, None]:
        started_s = time.process_time()
        outputs = skeleton.flush() if matches is None else skeleton.add(matches)
        pending_s += time.process_time() - started_s
        if outputs:
            states += [output.state for output in outputs]
            spent_s += [pending_s / len(outputs)] * len(outputs)
            pending_s = 0.0
    stamps_ns = np.array([state.stamp_ns for state in states])
    latency_ms = float("inf")
    if settings.smoother.output_delay != OFFLINE:
        frame_ms = 1e-6 * float(np.median(np.diff(stamps_ns)))
        latency_ms = settings.smoother.frames_behind * frame_ms + 1e3 * float(np.median(spent_s))
    poses = np.array([state.world_T_segment for state in states])
    return SolverRun(stamps_ns, poses, 1e3 * np.array(spent_s), latency_ms, _peak_mb(before))


def solver_errors(run: SolverRun, body: BodyModel, truth: TrueMotion) -> SolverErrors:
    """Errors of a run.

    Raises:
        RecordingError: the truth belongs to another recording or body.
    """
    inside = truth.covers(run.stamps_ns)
    segments = [segment for segment in body.segments if segment in truth.world_T_segment]
    if not inside.any() or len(segments) < 2:
        raise RecordingError(f"{truth.path}: covers no state, or has other segments than body {body.name}")
    stamps_ns = run.stamps_ns[inside]
    ours = {segment: run.world_T_segment[inside, body.segment_index[segment]] for segment in segments}
    true = {segment: truth.at(stamps_ns, segment) for segment in segments}
    origins, true_origins = (np.stack([p[:, :3, 3] for p in poses.values()], axis=1) for poses in (ours, true))
    scale, R, t = measures.alignment(origins, true_origins, with_scale=False)
    rotations = []
    for joint in body.tree_joints:
        if joint.parent in ours and joint.child in ours:
            turns = [_joint_rotations(poses[joint.parent], poses[joint.child]) for poses in (ours, true)]
            rotations.append(measures.rotation_errors(*turns, *measures.fit_constant_frames(*turns)))
    return SolverErrors(
        measures.position_errors(origins, true_origins, scale, R, t),
        np.stack(rotations, axis=1),
        jitter_of(origins, stamps_ns, float(np.median(np.diff(stamps_ns)))),
    )


def dark_in_turn(registered: Sequence[LandmarkMatches], each_s: float = 0.5) -> list[LandmarkMatches]:
    """The same registrations, one of four cameras at a time without landmarks or rotations between images."""
    names = sorted({matches.camera for matches in registered})
    begin_ns = min(matches.stamp_ns for matches in registered)
    dark = {
        "track_ids": np.zeros(0, np.uint32),
        "landmark_ids": np.zeros(0, np.uint32),
        "pixels": np.zeros((0, 2), np.float32),
        "points_world": np.zeros((0, 3), np.float32),
        "world_T_camera": None,
        "current_R_previous": np.eye(3),
        "rotation_inliers": 0,
    }

    def is_dark(matches: LandmarkMatches) -> bool:
        slot = int(1e-9 * (matches.stamp_ns - begin_ns) / each_s)
        return names.index(matches.camera) % DARK_ONE_OF == slot % DARK_ONE_OF

    return [replace(matches, **dark) if is_dark(matches) else matches for matches in registered]


def _joint_rotations(world_T_parent: Array, world_T_child: Array) -> Array:
    """Rotation (T, 3, 3) of a child in its parent."""
    parent_R_child: Array = np.swapaxes(world_T_parent[:, :3, :3], 1, 2) @ world_T_child[:, :3, :3]
    return parent_R_child


def _memory_after_collection() -> int:
    """Resident memory [bytes]; the process's peak begins anew, as far as this system can."""
    gc.collect()
    try:
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5")
    except (OSError, AttributeError):
        pass
    return memory_bytes()


def _peak_mb(before: int) -> float:
    """Growth of the process to its peak [MB]."""
    status = Path("/proc/self/status").read_text().split("VmHWM:")[1]
    return max(0.0, 1e-6 * (1024 * int(status.split()[0]) - before))


def _row(way: str, run: SolverRun, errors: SolverErrors) -> str:
    degrees = np.degrees(errors.rotations)
    values = (
        f"{100.0 * errors.positions.mean():.3f}",
        f"{100.0 * errors.positions.max():.2f}",
        f"{degrees.mean():.3f}",
        f"{np.percentile(degrees, 95):.2f}",
        f"{1e3 * np.nanmean(errors.jitter):.2f}",
        f"{np.median(run.solve_ms):.1f}",
        f"{np.percentile(run.solve_ms, 95):.1f}",
        f"{run.latency_ms:.0f}",
        f"{run.memory_mb:.0f}",
    )
    return f"{way:12}" + "".join(f"{value:>13}" for value in values)


def main() -> None:
    """Print a row for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--body", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    settings, body = PipelineSettings(), read_body(arguments.body)
    truth = read_true_motion(arguments.recording)
    cameras, registered = registrations(arguments.recording / "bag", arguments.map, body, settings, arguments.jobs)
    columns = ("position [cm]", "worst", "rotation [°]", "p95", "jitter [mm]", "CPU [ms]", "p95", "latency [ms]", "MB")
    for light, matches in (("as recorded", registered), ("a quarter dark in turn", dark_in_turn(registered))):
        print(f"{light}\n{'way':12}" + "".join(f"{column:>13}" for column in columns))
        for way, changed in WAYS.items():
            of_way = replace(settings, smoother=replace(settings.smoother, **changed))
            run = run_solver(body, cameras, matches, of_way)
            print(_row(way, run, solver_errors(run, body, truth)), flush=True)


if __name__ == "__main__":
    main()
