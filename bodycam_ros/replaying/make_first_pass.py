"""The first pass over a recording: clocks, read-out times and joints, by some seconds of it every two minutes."""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.mounted_cameras import evidence_floor
from bodycam_ros.estimation.pose_prior import PosePrior
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.readout_time import ReadoutLog
from bodycam_ros.replaying.camera_worker import RegistrationTask
from bodycam_ros.replaying.first_pass import BLOCK_S, EVERY_S, SAMPLE_S, FirstPass, block_bounds
from bodycam_ros.replaying.front_end import registered_images
from bodycam_ros.replaying.recorded_part import published_window
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.timing.camera_path import path_points
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_evidence import MAX_GAP_S
from bodycam_ros.timing.clock_state import ClockState, clock_at
from bodycam_ros.timing.stamps import SharedStamps

logger = logging.getLogger(__name__)

_LEAST_SAMPLES = 3
_WHOLE_S = 20.0  # of a recording that is its own sample
_STEP_NS = 100_000_000  # between two times at which joints are looked at
_JUMP_S, _JUMP_SIGMAS = 0.006, 5.0  # by which clocks of two samples differ beyond their drift if one was set


def make_first_pass(
    request: ReplayRequest,
    stretches: int,
    block_s: float = BLOCK_S,
    on_step: Callable[[str, float], None] = lambda step, share: None,
) -> FirstPass:
    """Find what all stretches of a recording share.

    Args:
        request: files and settings of the replay.
        stretches: how many there should be; fewer where they would be shorter than ``block_s``.
        block_s: time between two places at which cameras are tracked anew [s].
        on_step: called with the step, and the share of it that is done.

    Raises:
        BodycamError: as ``replay``.
        RecordingError: a clock was set meanwhile, so that stretches would have a wrong time.
    """
    request.check_stretches()
    request = request.in_parts()
    body = read_body(request.body)
    with open_recording(request.recording, request.names) as recording:
        mounted = [camera for camera in recording.cameras if camera in body.mounts]
        window_ns, _ = published_window(recording, mounted or recording.cameras, request.span, request.whole)
        last_ns = max(last for _, last in recording.camera_spans(mounted or recording.cameras).values())
        bounds_ns = block_bounds((window_ns[0], min(window_ns[1], last_ns + 1)), block_s)
        first_stamp_ns, ahead_ns = recording.first_stamp_ns, recording.recorded_ahead_ns
        readouts = ReadoutLog({camera: recording.camera_model(camera) for camera in mounted})
        for camera in mounted:
            readouts.extend({camera: known} if (known := recording.readout(camera)) is not None else {})
    samples_ns = _samples((bounds_ns[0], bounds_ns[-1]))
    registered: list[LandmarkMatches] = []
    if mounted and request.map is not None:
        task = RegistrationTask(
            request.recording,
            request.map,
            request.settings,
            with_messages=False,
            readouts=body.readout_starts,
            names=request.names,
            windows_ns=samples_ns,
            recorded_ahead_ns=ahead_ns,
            anew_ns=tuple(begin_ns for begin_ns, _ in samples_ns[1:]),
        )
        for image in registered_images(task, mounted, request.jobs, lambda share: on_step("first pass", share)):
            readouts.add(image.matches)
            registered.append(image.matches)
    shared, clocks = _clocks(body, mounted, request.settings, registered, samples_ns)
    return FirstPass(
        recording=(request.recording.resolve().name, first_stamp_ns),
        bounds_ns=bounds_ns,
        count=min(stretches, len(bounds_ns) - 1),
        recorded_ahead_ns=ahead_ns,
        shared=shared,
        clocks=clocks,
        readouts=readouts.readouts(),
        rotations=_rotations(body, registered, clocks, samples_ns),
    )


def _samples(window_ns: tuple[int, int]) -> tuple[tuple[int, int], ...]:
    """Windows, evenly over a recording [ns]."""
    begin_ns, end_ns = window_ns
    lasting_s = 1e-9 * (end_ns - begin_ns)
    if lasting_s <= _WHOLE_S:
        return (window_ns,)
    count = max(_LEAST_SAMPLES, round(lasting_s / EVERY_S))
    starts = np.linspace(begin_ns, end_ns - 1e9 * SAMPLE_S, count).astype(np.int64)
    return tuple((start, start + round(1e9 * SAMPLE_S)) for start in starts.tolist())


def _clocks(
    body: BodyModel,
    cameras: Sequence[str],
    settings: PipelineSettings,
    registered: Iterable[LandmarkMatches],
    samples_ns: Sequence[tuple[int, int]],
) -> tuple[SharedStamps | None, dict[str, tuple[ClockState, ...]]]:
    """Which cameras share their stamps, and the clocks, linear from sample to sample."""
    estimator = ClockEstimator(body, cameras, settings.clock, evidence_floor(settings.evidence), live=False)
    images = sorted(registered, key=lambda image: (image.stamp_ns, image.camera))
    found: dict[str, list[ClockState]] = {}
    for begin_ns, end_ns in samples_ns:
        own = [image for image in images if begin_ns <= image.stamp_ns < end_ns]
        if not own:
            continue
        for image in own:
            estimator.add(image)
        estimator.flush()
        for camera, clock in estimator.clocks.items():
            found.setdefault(camera, []).append(clock)
        estimator.restart()
    sharing = estimator.sharing
    return estimator.shared, {
        camera: _constant(clocks) if camera in sharing else _linear(camera, clocks) for camera, clocks in found.items()
    }


def _rotations(
    body: BodyModel,
    registered: Iterable[LandmarkMatches],
    clocks: Mapping[str, Sequence[ClockState]],
    samples_ns: Sequence[tuple[int, int]],
) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Joint -> how it was turned while cameras on both of its segments were registered (``FirstPass.rotations``)."""
    stamps_ns = np.concatenate([np.arange(*window_ns, _STEP_NS, dtype=np.int64) for window_ns in samples_ns])
    poses = np.tile(np.eye(4), (len(stamps_ns), len(body.segments), 1, 1))
    observed = np.zeros(poses.shape[:2], bool)
    by_camera: dict[str, list[tuple[int, Array]]] = {}
    for image in registered:
        if image.world_T_camera is not None:
            known = clocks.get(image.camera)
            ahead_ns = clock_at(known, image.stamp_ns).offset_ns(image.stamp_ns) if known else 0
            by_camera.setdefault(image.camera, []).append((image.stamp_ns - ahead_ns, image.world_T_camera))
    for camera, images in sorted(by_camera.items()):
        own_ns, own_poses = map(np.array, zip(*images, strict=True))
        points, mount = path_points(own_ns, own_poses, stamps_ns, MAX_GAP_S), body.mounts[camera]
        segment = body.segment_index[mount.segment]
        poses[points.rows, segment] = points.poses @ inverse(mount.segment_T_camera)
        observed[points.rows, segment] = True
    parents, children = body.joint_ends.T
    both_observed = observed[:, parents] & observed[:, children]
    sums = PosePrior(body).joint_sums(body.joint_rotations(poses), both_observed, 1e-9 * _STEP_NS)
    return {joint: tuple(tuple(row) for row in each.tolist()) for joint, each in sums.items()}


def _constant(clocks: Sequence[ClockState]) -> tuple[ClockState, ...]:
    """The clock of a camera that shares its stamps, which are used as they are."""
    return (ClockState(clocks[0].since_ns, clocks[0].since_ns, 0.0, 0.0, clocks[-1].offset_sigma, 0.0),)


def _linear(camera: str, clocks: Sequence[ClockState]) -> tuple[ClockState, ...]:
    """A clock that goes from each estimate to the next in a straight line.

    Raises:
        RecordingError: it was set between two of them.
    """
    pieces = []
    for before, after in pairwise(clocks):
        seconds = 1e-9 * (after.at_ns - before.at_ns)
        by_s = after.offset - before.offset - before.drift * seconds
        if abs(by_s) > max(_JUMP_S, _JUMP_SIGMAS * float(np.hypot(before.offset_sigma, before.drift_sigma * seconds))):
            raise RecordingError(
                f"camera {camera}: its clock was set while the recording ran, by {1e3 * by_s:+z.0f} ms: stretches "
                "of the recording have no common time; replay it in one go"
            )
        drift = (after.offset - before.offset) / seconds
        pieces.append(
            ClockState(before.at_ns, before.at_ns, before.offset, drift, before.offset_sigma, before.drift_sigma)
        )
    last = clocks[-1]
    since_ns = clocks[0].since_ns if not pieces else last.at_ns
    pieces.append(ClockState(since_ns, last.at_ns, last.offset, last.drift, last.offset_sigma, last.drift_sigma))
    return tuple(pieces)
