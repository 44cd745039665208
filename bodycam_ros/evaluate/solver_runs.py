"""Four ways to a body's motion from the same registrations: what each comes to, how long it takes, and how much memory.

``Way.ALONE`` is A figure 6a, ``Way.SLIDING`` the paper's sliding window, ``Way.BATCH`` everything at once.
"""

import ctypes
import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.evaluate.endurance import memory_bytes
from bodycam_ros.evaluate.full_batch import levenberg_marquardt
from bodycam_ros.geometry import Array
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.block_solver import Block, solve_block
from bodycam_ros.solving.body_factors import BodyFactors
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_smoother import BodySmoother
from bodycam_ros.solving.camera_evidence import MountedCameras, evidence_floor
from bodycam_ros.solving.contact import FootContacts
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.forward_states import ForwardStates
from bodycam_ros.solving.frame_assembler import FrameAssembler
from bodycam_ros.solving.smooth_motion import MotionLimits, SmoothMotion
from bodycam_ros.solving.smoother_settings import OFFLINE
from bodycam_ros.solving.start_poses import first_poses
from bodycam_ros.solving.whole_recording import WholeRecording
from bodycam_ros.timing.body_instants import BodyInstants

DARK_ONE_OF = 4
"""So many cameras take turns in being dark."""

_MOST_STEPS = 15
_ALL_S = 600.0  # the longest block that there is
_HANGS = np.full(6, 0.5)  # [rad], [m] what no camera sees, and no past tells of, hangs as in the N-pose


class Way(Enum):
    """How instants are solved, for people to read; LM is Levenberg-Marquardt.

    Ours are those by iSAM2, which wait for some later frames, and ``OFFLINE``.
    """

    ALONE = "alone"
    SLIDING = "window, LM"
    FILTER = "iSAM2 + 0"
    SHORT = "iSAM2 + 2"
    WINDOW = "iSAM2 + 4"
    OFFLINE = "offline"
    BATCH = "full batch, LM"

    @property
    def at_once(self) -> bool:
        """Whether many instants are solved together, so that none has a time of its own."""
        return self in (Way.OFFLINE, Way.BATCH)


_LATER = {Way.FILTER: 0, Way.SHORT: 2, Way.WINDOW: 4}
"""Frames that follow before an instant is answered."""


@dataclass(frozen=True, eq=False)
class SolverRun:
    """What came of one way.

    Attributes:
        way: which.
        stamps_ns: (T,) instants.
        world_T_segment: (T, S, 4, 4) poses, in the order of the body's segments.
        solve_ms: (T,) milliseconds of CPU of an instant; of ways that solve many at once each has its share.
        memory_mb: by which the process grew at most.
        latency_ms: from an instant to its state, waiting for later ones and solving; infinite where all are waited for.
    """

    way: Way
    stamps_ns: NDArray[np.int64]
    world_T_segment: Array
    solve_ms: Array
    memory_mb: float
    latency_ms: float


def body_frames(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: Sequence[LandmarkMatches],
    settings: PipelineSettings,
) -> list[BodyFrame]:
    """What the cameras say of each instant of the body, with their clocks corrected."""
    on_body = [camera for camera in cameras if camera in body.mounts]
    instants = BodyInstants(body, dict(cameras), settings.clock, evidence_floor(settings.evidence), live=False)
    assembler = FrameAssembler(on_body, settings.assembler, False)
    said = [of_instant for matches in registered for of_instant in instants.add(matches)] + instants.flush()
    return [frame for matches in said for frame in assembler.add(matches)] + list(assembler.flush())


def dark_in_turn(registered: Sequence[LandmarkMatches], each_s: float = 0.5) -> list[LandmarkMatches]:
    """The same registrations, but every fourth camera at a time sees nothing, for so long each.

    Its images are black: no landmark, and no rotation since the one before.
    """
    changed = []
    names = sorted({matches.camera for matches in registered})
    begin_ns = min(matches.stamp_ns for matches in registered)
    nothing = np.zeros(0, np.uint32)
    for matches in registered:
        slot = int(1e-9 * (matches.stamp_ns - begin_ns) / each_s)
        if names.index(matches.camera) % DARK_ONE_OF == slot % DARK_ONE_OF:
            matches = replace(
                matches,
                track_ids=nothing,
                landmark_ids=nothing,
                pixels=np.zeros((0, 2), np.float32),
                points_world=np.zeros((0, 3), np.float32),
                world_T_camera=None,
                current_R_previous=np.eye(3),
                rotation_inliers=0,
            )
        changed.append(matches)
    return changed


def run_solver(
    way: Way,
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    frames: Sequence[BodyFrame],
    settings: PipelineSettings,
    on_instant: Callable[[], None] = lambda: None,
) -> SolverRun:
    """Solve all frames in one way.

    Args:
        way: how.
        body: with its mounts.
        cameras: models by name.
        frames: in order of time.
        settings: of all stages.
        on_instant: called after each frame.
    """
    _forget_peak()
    before = memory_bytes()
    if way is Way.ALONE:
        solved = [_alone(body, frame, settings, on_instant) for frame in frames]
        stamps_ns, poses, solve_ms = (np.array(column) for column in zip(*filter(None, solved), strict=True))
        return SolverRun(way, stamps_ns, poses, solve_ms, _peak_mb(before), float(np.median(solve_ms)))
    smoother = _smoother(way, body, cameras, settings)
    states, spent_s = [], []
    for frame in frames:
        started_s = time.process_time()
        states += smoother.update(frame)
        spent_s.append(time.process_time() - started_s)
        on_instant()
    started_s = time.process_time()
    states += smoother.flush()
    last_s = time.process_time() - started_s
    stamps_ns = np.array([state.stamp_ns for state in states])
    latency_ms = float("inf")
    if way.at_once:
        spent_s = [(sum(spent_s) + last_s) / len(states)] * len(states)
    else:
        wait_ms = _LATER.get(way, settings.smoother.frames_behind) * 1e-6 * float(np.median(np.diff(stamps_ns)))
        latency_ms = wait_ms + 1e3 * float(np.median(spent_s))
    poses = np.array([state.world_T_segment for state in states])
    return SolverRun(way, stamps_ns, poses, 1e3 * np.array(spent_s), _peak_mb(before), latency_ms)


def _smoother(
    way: Way, body: BodyModel, cameras: Mapping[str, CameraModel], settings: PipelineSettings
) -> BodySmoother:
    smoother = replace(settings.smoother, output_delay=_LATER.get(way, settings.smoother.output_delay))
    if way is Way.SLIDING:
        smoother = replace(smoother, incremental=False)
    elif way is Way.OFFLINE:
        smoother = replace(smoother, output_delay=OFFLINE)
    elif way is Way.BATCH:
        smoother = replace(smoother, output_delay=OFFLINE, block=_ALL_S)
    return (_BatchSmoother if way is Way.BATCH else BodySmoother)(
        body,
        cameras,
        smoother,
        settings.motion,
        settings.evidence,
        settings.trust,
        settings.memory,
        settings.covariance,
        settings.pose_fit,
        offline=True,
        contacts=FootContacts(body, settings.contact),
    )


class _BatchSmoother(BodySmoother):
    """Leaves the whole recording to gtsam's own solver."""

    def outgoing(self) -> ForwardStates | WholeRecording:
        outgoing = super().outgoing()
        if isinstance(outgoing, WholeRecording):
            outgoing.solve = levenberg_marquardt
        return outgoing


def _alone(
    body: BodyModel, frame: BodyFrame, settings: PipelineSettings, on_instant: Callable[[], None]
) -> tuple[int, Array, float] | None:
    """Stamp [ns], poses (S, 4, 4) and milliseconds of an instant that knows of no other; None if no camera speaks."""
    started_s = time.process_time()
    on_instant()
    evidence = MountedCameras(body, settings.evidence).absolute_evidence(frame.matches.values()).values()
    if not evidence:
        return None
    factors = BodyFactors(body, settings.smoother.outlier_sigmas)
    start = first_poses(body, evidence)
    graph = factors.cameras(0, evidence)
    graph.push_back(factors.anchor(0, dict(enumerate(start)), _HANGS))
    nothing = ExpectedJoints(np.zeros(0, int), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))

    def joints(poses: Array) -> gtsam.NonlinearFactorGraph:
        return factors.joints(0, poses[0], nothing)

    motion = SmoothMotion(MotionLimits.of(settings.motion, len(body.segments)), np.array([frame.stamp_ns]))
    poses = solve_block(Block(0, graph, joints, motion), start[None], _MOST_STEPS)[0]
    return frame.stamp_ns, poses, 1e3 * (time.process_time() - started_s)


def _forget_peak() -> None:
    """Let the process's peak of memory begin anew, as far as this system can."""
    gc.collect()
    try:
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5")
    except (OSError, AttributeError):
        pass


def _peak_mb(before: int) -> float:
    """How far [MB] the process grew beyond what it had before."""
    status = Path("/proc/self/status").read_text().split("VmHWM:")[1]
    return max(0.0, 1e-6 * (1024 * int(status.split()[0]) - before))
