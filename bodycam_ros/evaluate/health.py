"""What a solved recording says about its body and its cameras, without any truth."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.comparison import Distribution, distance_in_time
from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.results.camera_record import CameraRecord
from bodycam_ros.results.overlay import project_overlay
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.timing.clock_state import ClockHistory

_FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
_EVEN_SHARE = 0.2
"""Steps in time count as even if they differ from the usual one by no more than this share."""

_ROUNDING_NS = 1.0


def image_stamps(solved: SolvedRecording) -> NDArray[np.int64]:
    """Stamps of all cameras' images, sorted [ns]."""
    stamps: NDArray[np.int64] = np.sort(np.concatenate(solved.image_stamps_ns))
    return stamps


def image_coverage(solved: SolvedRecording) -> float:
    """Share of the images with a solved instant within half a frame, or half the time between instants."""
    half_ns = max(solved.frame_ns, solved.instant_ns) / 2.0
    return float(np.mean(distance_in_time(image_stamps(solved), solved.stamps_ns) <= half_ns + _ROUNDING_NS))


def gaps(solved: SolvedRecording) -> tuple[tuple[float, float], ...]:
    """(start, end) [s] of each stretch of the recording without a solved instant, both ends included."""
    images = image_stamps(solved)
    one_frame = max(solved.frame_ns, solved.instant_ns)
    # As if an instant were solved a frame before the first image and a frame after the last.
    edges = np.concatenate([[images[0] - one_frame], solved.stamps_ns, [images[-1] + one_frame]])
    wide = np.flatnonzero(np.diff(edges) > solved.longest_step_ns)
    # Free-running cameras see a little more at either end than the instants between them.
    wide = wide[edges[wide + 1] - edges[wide] >= 2 * one_frame - _EVEN_SHARE * one_frame]
    starts, ends = solved.seconds(edges[wide] + one_frame), solved.seconds(edges[wide + 1] - one_frame)
    return tuple(zip(starts.tolist(), ends.tolist(), strict=True))


def blind(solved: SolvedRecording) -> NDArray[np.bool_]:
    """(T,) instants that no registered camera speaks about, nor a static one: the body follows from motion alone."""
    worn = [record.stamps_ns[record.registered] for record in solved.cameras]
    seen = np.concatenate([*worn, *(record.stamps_ns[record.sees] for record in solved.stations)])
    if not len(seen):
        return np.ones(len(solved.stamps_ns), dtype=bool)
    nothing_near: NDArray[np.bool_] = distance_in_time(solved.stamps_ns, np.sort(seen)) > solved.frame_ns / 2.0
    return nothing_near


def root_sigmas(root_covariance: Array) -> tuple[Array, Array]:
    """Standard deviations (T,) of the root's position [m] and rotation [rad]: square roots of the blocks' traces."""
    variances = np.diagonal(root_covariance, axis1=1, axis2=2)
    return np.sqrt(variances[:, 3:].sum(axis=1)), np.sqrt(variances[:, :3].sum(axis=1))


def angle_ranges(solved: SolvedRecording) -> dict[str, tuple[float, float]]:
    """Joint -> the least and the greatest of its angles [rad]; without those that slide."""
    angles = solved.motion.joint_angles
    slide = {name for joint in solved.body.tree_joints if joint.type == "free" for name in joint.angle_names[:3]}
    ends = zip(angles.min(axis=0).tolist(), angles.max(axis=0).tolist(), strict=True)
    return {name: pair for name, pair in zip(solved.motion.joint_names, ends, strict=True) if name not in slide}


def jitter(solved: SolvedRecording) -> Array:
    """Noise (T, S) of the body's segments' origins [m], see ``jitter_of``."""
    origins = np.stack([solved.world_T_link[segment][:, :3, 3] for segment in solved.body_segments], axis=1)
    return jitter_of(origins, solved.stamps_ns, solved.instant_ns)


def jitter_of(origins: Array, stamps_ns: NDArray[np.int64], instant_ns: float) -> Array:
    """Noise (T, S) of points (T, S, 3) [m]: the fourth difference over time, divided by sqrt(70).

    For white noise its mean square is the noise's own, over three axes; a motion up to the third order in time leaves
    nothing. NaN at the ends and beside gaps.
    """
    noise = np.full(origins.shape[:2], np.nan)
    width = len(_FOURTH_DIFFERENCE)
    if len(origins) < width:
        return noise
    windows = np.lib.stride_tricks.sliding_window_view(origins, width, axis=0)
    differences = np.linalg.norm(windows @ _FOURTH_DIFFERENCE, axis=-1) / np.linalg.norm(_FOURTH_DIFFERENCE)
    even = np.abs(np.diff(stamps_ns) - instant_ns) <= _EVEN_SHARE * instant_ns
    all_even = np.asarray(np.lib.stride_tricks.sliding_window_view(even, width - 1).all(axis=-1), dtype=np.bool_)
    noise[width // 2 : -(width // 2)] = np.where(all_even[:, None], differences, np.nan)
    return noise


@dataclass(frozen=True)
class CameraHealth:
    """How one camera did.

    Attributes:
        camera: name.
        images: that were tracked.
        registered: share of them with a pose.
        sights: what it knew -> share of them.
        longest_lost_s: the longest time without a pose [s].
        tracks: mean of feature tracks per image; NaN where the bag does not say.
        landmarks: mean of tracks with a landmark per image; NaN where the bag does not say.
        image_motion: of the picture from image to image, which blurs it [px].
        position_gap: distance of the registered from the solved position of the camera [m].
        rotation_gap: angle between the two orientations [rad].
        timing: its clock and its rows; None where the bag does not say.
        reprojection: of landmarks in the solved pose [px]; None unless the recording's intrinsics were given.
    """

    camera: str
    images: int
    registered: float
    sights: Mapping[CameraSight, float]
    longest_lost_s: float
    tracks: float
    landmarks: float
    image_motion: Distribution
    position_gap: Distribution
    rotation_gap: Distribution
    timing: ClockHistory | None = None
    reprojection: Distribution | None = None


def camera_healths(solved: SolvedRecording) -> tuple[CameraHealth, ...]:
    """The health of each camera."""
    return tuple(_health(record, solved) for record in solved.cameras)


def longest_lost(stamps_ns: NDArray[np.int64], registered: NDArray[np.bool_], frame_ns: int) -> float:
    """Longest run of images (K,) without a pose [s]; an image stands for one frame."""
    longest_ns, since = 0, None
    for stamp, known in zip(stamps_ns.tolist(), registered.tolist(), strict=True):
        if known:
            since = None
            continue
        since = stamp if since is None else since
        longest_ns = max(longest_ns, stamp - since + frame_ns)
    return longest_ns * 1e-9


def pose_gaps(solved: SolvedRecording, record: CameraRecord) -> tuple[Array, Array]:
    """Distances (N,) [m] and angles (N,) [rad] between registered and solved poses of a camera.

    The registration knows this camera alone, the solution all cameras and the body: a gap that stays tells of a mount
    that has moved or a wrong body, one that comes and goes of bad registrations.
    """
    solved_pose = dict((r.camera, poses) for r, poses in solved.solved_cameras()).get(record.camera)
    usable = record.registered & solved.is_solved_at(record.stamps_ns)
    if solved_pose is None or not usable.any():
        return np.zeros(0), np.zeros(0)
    world_T_solved = interpolated(solved.stamps_ns, solved_pose, record.stamps_ns[usable])
    solved_T_registered = inverse(world_T_solved) @ record.world_T_camera[usable]
    return (
        np.linalg.norm(solved_T_registered[:, :3, 3], axis=1),
        np.linalg.norm(log_so3(solved_T_registered[:, :3, :3]), axis=1),
    )


def camera_models(solved: SolvedRecording, recording: Path) -> dict[str, CameraModel]:
    """The models of the worn cameras that were solved, from the recording: a solved bag has no intrinsics.

    Raises:
        RecordingError: not a recording, or not of these cameras.
        LensError: the recording's intrinsics cannot be used.
    """
    mounted = [record.camera for record, _ in solved.solved_cameras()]
    with open_recording(recording) as cameras:
        models = {camera: cameras.camera_model(camera) for camera in mounted if camera in cameras.cameras}
        if mounted and not models:
            raise RecordingError(
                f"{recording} has none of the cameras of {solved.path}: {', '.join(mounted)}; it has "
                f"{', '.join(cameras.cameras)}"
            )
    return models


def reprojection_errors(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> dict[str, Distribution]:
    """Camera -> distances [px] of its named tracks from their landmarks, seen from the solved pose.

    Outliers are among them: the median is the accuracy, the tail counts false names and slipped tracks.

    Args:
        solved: the body.
        models: of its cameras.

    Raises:
        RecordingError: the bag is damaged.
    """
    poses = {record.camera: world_T_camera for record, world_T_camera in solved.solved_cameras()}
    errors: dict[str, list[Array]] = {camera: [] for camera in models}
    for matches in solved.landmarks(models):
        at_ns = np.array([matches.stamp_ns])
        if solved.is_solved_at(at_ns).all():
            world_T_camera = interpolated(solved.stamps_ns, poses[matches.camera], at_ns)[0]
            errors[matches.camera].append(project_overlay(models[matches.camera], world_T_camera, (), matches).errors)
    return {camera: Distribution.of(np.concatenate([np.zeros(0), *values])) for camera, values in errors.items()}


def image_motion(record: CameraRecord) -> Array:
    """Motion of a camera's picture (K,) [px per image], interpolated over images without tracks; NaN without any."""
    known = np.isfinite(record.image_motion)
    if not known.any():
        return np.full(len(known), np.nan)
    return np.interp(record.stamps_ns, record.stamps_ns[known], record.image_motion[known])


def _health(record: CameraRecord, solved: SolvedRecording) -> CameraHealth:
    distances, angles = pose_gaps(solved, record)
    known = record.tracks[record.tracks >= 0]
    said = record.landmarks.any() or not record.registered.any()  # nobody registers by no landmark
    return CameraHealth(
        camera=record.camera,
        images=len(record.stamps_ns),
        registered=float(record.registered.mean()),
        sights={sight: float(np.mean(record.sights == sight)) for sight in CameraSight},
        longest_lost_s=longest_lost(record.stamps_ns, record.registered, solved.frame_ns),
        tracks=float(known.mean()) if len(known) else float("nan"),
        landmarks=float(record.landmarks.mean()) if said else float("nan"),
        image_motion=Distribution.of(image_motion(record)),
        position_gap=Distribution.of(distances),
        rotation_gap=Distribution.of(angles),
        timing=record.timing,
    )
