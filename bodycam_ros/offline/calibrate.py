"""A recorded range of motion in, a body out, offline (A 4.2)."""

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.calibration.camera_motion import MotionLogSettings
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.offline.camera_worker import DroppedImages, LostImages, RegisteredImage, RegistrationTask
from bodycam_ros.offline.front_end import register_recording, warm_up
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap, check_upright

logger = logging.getLogger(__name__)

_KEYFRAMES_PER_TRACK = 0.8
"""Of a track's life until the next keyframe, whose keypoints find their landmarks around the pose of older tracks."""

Progress = Callable[[str, float], None]
"""Called with the name of a step and the share of it that is done, 0 to 1."""


def calibrate(
    recording_path: Path,
    map_path: Path,
    rig: Rig,
    name: str,
    pipeline: PipelineSettings,
    settings: CalibrationSettings,
    jobs: int,
    facing_rad: float | None = None,
    on_progress: Progress = lambda step, share: None,
) -> CalibratedBody:
    """Estimate the body of a recorded range of motion.

    Args:
        recording_path: ros2 bag folder or .mcap file.
        map_path: folder of the reference map.
        rig: which camera is on which segment.
        name: of the body.
        pipeline: settings of tracking and registration, and the noise that the solver knows.
        settings: of the calibration.
        jobs: processes for the cameras.
        facing_rad: which way the person faces in the N-pose [rad]; None to read it off hips and shoulders.
        on_progress: told how far it is.

    Raises:
        BodycamError: anything that is wrong with the input, or a motion that does not tell enough.
    """
    warm_up()
    check_upright(ReferenceMap.load(map_path), map_path)
    with open_recording(recording_path) as recording:
        if missing := [camera for camera in rig.cameras if camera not in recording.cameras]:
            raise RangeOfMotionError(
                f"{recording_path}: lacks camera {', '.join(missing)} of the rig; it has {', '.join(recording.cameras)}"
            )
        models = {camera: recording.camera_model(camera) for camera in rig.cameras}
        modes = {camera: recording.video_mode(camera) for camera in rig.cameras}
        duration_s = recording.duration_s
    calibrator = BodyCalibrator(
        rig,
        models,
        settings,
        pipeline.pose_fit,
        pipeline.evidence,
        facing_rad,
        pipeline.clock,
        pipeline.readout,
        modes,
    )
    task = RegistrationTask(
        recording_path,
        map_path,
        _with_fresh_tracks(pipeline, settings.motion_log),
        max_rate=settings.motion_log.max_rate,
        with_messages=False,
    )
    start_ns = None
    unusable: Counter[str] = Counter()
    for item in register_recording(task, models, jobs):
        if isinstance(item, RegisteredImage):
            start_ns = item.stamp_ns if start_ns is None else start_ns
            calibrator.add(item.matches)
            on_progress("registration", 1e-9 * (item.stamp_ns - start_ns) / max(duration_s, 1e-9))
        elif isinstance(item, LostImages):
            logger.warning("%s", item)
        else:
            unusable[item.camera] += item.count if isinstance(item, DroppedImages) else 1
    for camera, count in sorted(unusable.items()):
        logger.warning("camera %s: %d images could not be used", camera, count)
    # The matrices are many and small: threads of the linear algebra would only wait for each other.
    with threadpool_limits(limits=1):
        return calibrator.solve(name, on_progress)


def _with_fresh_tracks(pipeline: PipelineSettings, log: MotionLogSettings) -> PipelineSettings:
    """The tracker's settings for a calibration: short tracks, and keyframes so often that each track sees another."""
    interval = max(1, round(_KEYFRAMES_PER_TRACK * log.track_age * log.max_rate))
    tracker = replace(
        pipeline.tracker,
        keyframe_interval=min(interval, pipeline.tracker.keyframe_interval),
        max_track_age=min(log.track_age, pipeline.tracker.max_track_age),
    )
    return replace(pipeline, tracker=tracker)
