"""Figures of a solved recording's cameras, with their inertial sensors, and of its body, without any truth."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.figures import CameraFigures, ClockFigures, SensorFigures, StationFigures, spread
from bodycam_ros.geometry import Array, inverse, log_so3
from bodycam_ros.inertial.imu_samples import GRAVITY, ImuSamples
from bodycam_ros.quality.sensor_checks import sensor_quality
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.body_motion import distance_in_time, interpolated
from bodycam_ros.results.camera_picture import project_landmarks
from bodycam_ros.results.solved_recording import CameraRecord, SolvedRecording, StaticCameraRecord
from bodycam_ros.timing.clock_state import ClockHistory

_EVEN_SHARE = 0.2  # by which even steps in time may differ from the usual one
_ROUNDING_NS = 1.0


def image_coverage(solved: SolvedRecording) -> float:
    """Share of the images with a solved state within half a frame, or half the time between states."""
    half_ns = max(solved.frame_ns, solved.step_ns) / 2.0
    images = np.concatenate(solved.image_stamps_ns)
    return float(np.mean(distance_in_time(images, solved.stamps_ns) <= half_ns + _ROUNDING_NS))


def gaps(solved: SolvedRecording) -> list[list[float]]:
    """[start, end] [s] of each stretch of the recording without a solved state, both ends included."""
    images = np.sort(np.concatenate(solved.image_stamps_ns))
    one_frame = max(solved.frame_ns, solved.step_ns)
    # As if a state were solved a frame before the first image and a frame after the last.
    edges = np.concatenate([[images[0] - one_frame], solved.stamps_ns, [images[-1] + one_frame]])
    wide = np.flatnonzero(np.diff(edges) > solved.longest_step_ns)
    # Images of free-running cameras begin a little before the states between them and end after them.
    wide = wide[edges[wide + 1] - edges[wide] >= 2 * one_frame - _EVEN_SHARE * one_frame]
    found: list[list[float]] = solved.seconds(
        np.stack([edges[wide] + one_frame, edges[wide + 1] - one_frame], 1)
    ).tolist()
    return found


def blind(solved: SolvedRecording) -> NDArray[np.bool_]:
    """(T,) states near which no camera was registered and no static one observed the body."""
    body_cameras = [record.stamps_ns[record.registered] for record in solved.cameras]
    known = np.concatenate([*body_cameras, *(record.stamps_ns[record.observes] for record in solved.stations)])
    far: NDArray[np.bool_] = distance_in_time(solved.stamps_ns, np.sort(known)) > solved.frame_ns / 2.0
    return far


def angle_ranges_deg(solved: SolvedRecording) -> dict[str, list[float]]:
    """Joint -> least and greatest of its angles [deg]; without places of free joints."""
    angles = np.degrees(solved.joint_angles)
    slide = {name for joint in solved.body.tree_joints if joint.type == "free" for name in joint.angle_names[:3]}
    ends = np.stack([angles.min(axis=0), angles.max(axis=0)], axis=1).tolist()
    return {name: pair for name, pair in zip(solved.joint_names, ends, strict=True) if name not in slide}


def jitter(solved: SolvedRecording) -> Array:
    """Noise (T, S) of the origins of the body's segments [m]: the fourth difference over time, divided by sqrt(70).

    For white noise its mean square is the noise's own, over three axes; a motion up to the third order in time leaves
    nothing. NaN at the ends and beside gaps.
    """
    origins = np.stack([solved.world_T_link[segment][:, :3, 3] for segment in solved.body_segments], axis=1)
    noise = np.full(origins.shape[:2], np.nan)
    if len(origins) > 4:
        odd = np.abs(np.diff(solved.stamps_ns) - solved.step_ns) > _EVEN_SHARE * solved.step_ns
        differences = np.linalg.norm(np.diff(origins, n=4, axis=0), axis=-1) / np.sqrt(70.0)
        noise[2:-2] = np.where(np.convolve(odd, np.ones(4), "valid")[:, None] > 0.5, np.nan, differences)
    return noise


def camera_figures(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> dict[str, CameraFigures]:
    """Body camera -> its figures.

    Args:
        solved: the recording.
        models: camera -> its lens, for reprojection errors; those without are left out.

    Raises:
        RecordingError: the bag is damaged.
    """
    poses = {record.camera: world_T_camera for record, world_T_camera in solved.solved_cameras()}
    figures = {}
    for record in solved.cameras:
        position_gap, rotation_gap = _pose_gaps(solved, record, poses.get(record.camera))
        has_landmarks = record.landmarks.any() or not record.registered.any()  # else a slim bag
        figures[record.camera] = CameraFigures(
            images=len(record.stamps_ns),
            registered=float(record.registered.mean()),
            sight={sight.label: float(np.mean(record.sights == sight)) for sight in CameraSight},
            longest_lost_s=_longest_lost_s(record, solved.frame_ns),
            landmarks=float(record.landmarks.mean()) if has_landmarks else np.nan,
            position_gap_mm=spread(position_gap, 1e3),
            rotation_gap_deg=spread(rotation_gap, np.degrees(1.0)),
            clock=None if record.timing is None else _clock_figures(record.timing),
        )
    for camera, errors in _reprojection_errors(solved, models, poses).items():
        figures[camera] = msgspec.structs.replace(figures[camera], reprojection_px=spread(errors))
    return figures


def _longest_lost_s(record: CameraRecord, frame_ns: int) -> float:
    """Longest time without a pose [s]; an image stands for one frame."""
    ends = record.stamps_ns[0] - frame_ns, record.stamps_ns[-1] + frame_ns
    known = np.concatenate([ends[:1], record.stamps_ns[record.registered], ends[1:]])
    runs = np.searchsorted(record.stamps_ns, known[1:]) - np.searchsorted(record.stamps_ns, known[:-1], "right")
    return 1e-9 * float(np.where(runs > 0, np.diff(known) - frame_ns, 0).max())


def _pose_gaps(solved: SolvedRecording, record: CameraRecord, world_T_camera: Array | None) -> tuple[Array, Array]:
    """Distances (N,) [m] and angles (N,) [rad] between registered and solved poses of a camera."""
    usable = record.registered & solved.is_solved_at(record.stamps_ns)
    if world_T_camera is None or not usable.any():
        return np.zeros(0), np.zeros(0)
    world_T_solved = interpolated(solved.stamps_ns, world_T_camera, record.stamps_ns[usable])
    gap = inverse(world_T_solved) @ record.world_T_camera[usable]
    return np.linalg.norm(gap[:, :3, 3], axis=1), np.linalg.norm(log_so3(gap[:, :3, :3]), axis=1)


def _clock_figures(timing: ClockHistory) -> ClockFigures:
    clock = timing.latest
    first_ns = timing.clocks[0].since_ns
    readout = timing.readout or Readout(math.nan, math.nan)
    return ClockFigures(
        is_off=timing.is_off,
        ahead_ms=1e3 * clock.offset,
        ahead_sigma_ms=1e3 * clock.offset_sigma,
        drift_ppm=1e6 * clock.drift,
        drift_sigma_ppm=1e6 * clock.drift_sigma,
        held_from_s=[1e-9 * (later.since_ns - first_ns) for later in timing.clocks[1:]],
        readout_ms=1e3 * readout.seconds,
        readout_sigma_ms=1e3 * readout.sigma,
    )


def camera_models(solved: SolvedRecording, recording: Path) -> dict[str, CameraModel]:
    """The models of the body cameras that were solved, from the recording: a solved bag has no intrinsics.

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


def _reprojection_errors(
    solved: SolvedRecording, models: Mapping[str, CameraModel], poses: Mapping[str, Array]
) -> dict[str, Array]:
    """Camera -> distances [px] between its named tracks and their landmarks in the solved pose.

    Outliers are among them: the median is the accuracy, the tail counts false names and slipped tracks.
    """
    errors = {camera: [np.zeros(0)] for camera in models}
    for matches in solved.landmarks(models):
        at_ns = np.array([matches.stamp_ns])
        if solved.is_solved_at(at_ns).all():
            world_T_camera = interpolated(solved.stamps_ns, poses[matches.camera], at_ns)[0]
            shown, projected = project_landmarks(models[matches.camera], world_T_camera, matches)
            errors[matches.camera].append(np.linalg.norm(projected - shown, axis=1))
    return {camera: np.concatenate(values) for camera, values in errors.items()}


def static_camera_figures(record: StaticCameraRecord) -> StationFigures:
    """Figures of a static camera."""
    return StationFigures(
        images=len(record.stamps_ns),
        seen=float(record.observes.mean()),
        segments=float(record.segments.mean()),
        confidence=float(record.confidence.mean()),
    )


@dataclass(frozen=True, eq=False)
class GyroscopeResiduals:
    """One gyroscope, corrected by the body file, less the solved angular velocity of its camera.

    Attributes:
        seconds: (N,) since the first state [s].
        rad_s: (N, 3) in the camera's axes, means from state to state [rad/s].
    """

    seconds: Array
    rad_s: Array


def sensor_figures(
    sensors: Mapping[str, ImuSamples], residuals: Mapping[str, GyroscopeResiduals]
) -> dict[str, SensorFigures]:
    """Camera -> figures of its inertial sensor; ``residuals``: of those that the body file calibrates."""
    figures, degrees = {}, np.degrees(1.0)
    for camera, samples in sensors.items():
        quality = sensor_quality(samples)
        rad_s = residuals[camera].rad_s if camera in residuals else np.full((1, 3), np.nan)
        change = np.median(rad_s, axis=0)
        figures[camera] = SensorFigures(
            rate_hz=quality.rate_hz,
            gyro_noise_deg_s=degrees * quality.gyro_noise,
            accelerometer_noise_micro_g=1e6 * quality.accelerometer_noise / GRAVITY,
            rest_bias_deg_s=degrees * quality.bias,
            bias_change_deg_s=degrees * float(np.linalg.norm(change)),
            residual_deg_s=spread(np.linalg.norm(rad_s - change, axis=1), degrees).median,
        )
    return figures


def gyroscope_residuals(solved: SolvedRecording, sensors: Mapping[str, ImuSamples]) -> dict[str, GyroscopeResiduals]:
    """Camera -> its gyroscope less its solved angular velocity, of cameras whose sensor the body file calibrates."""
    found = {}
    for record, world_T_camera in solved.solved_cameras():
        imu = solved.body.mounts[record.camera].imu
        if imu is not None and record.camera in sensors:
            each = _residuals(solved, record, world_T_camera, imu.correct(sensors[record.camera]))
            if len(each.seconds):
                found[record.camera] = each
    return found


def _residuals(
    solved: SolvedRecording, record: CameraRecord, world_T_camera: Array, corrected: ImuSamples
) -> GyroscopeResiduals:
    R, seconds = world_T_camera[:, :3, :3], solved.seconds(solved.stamps_ns)
    sensor_s, w = solved.seconds(record.time_of(corrected.stamps_ns)), corrected.angular_velocity
    integral = cumulative_trapezoid(w, sensor_s, axis=0, initial=0.0)
    turned = np.stack([np.interp(seconds, sensor_s, column, np.nan, np.nan) for column in integral.T], axis=1)
    solved_turn = log_so3(np.swapaxes(R[:-1], 1, 2) @ R[1:])
    residuals = (np.diff(turned, axis=0) - solved_turn) / np.diff(seconds)[:, None]
    usable = np.isfinite(residuals).all(axis=1) & (np.diff(solved.stamps_ns) <= solved.longest_step_ns)
    return GyroscopeResiduals(seconds[1:][usable], residuals[usable])
