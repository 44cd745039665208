"""How well the solved body explains what the cameras saw, in pixels. Needs the intrinsics, which the OUT bag lacks."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.distribution import Distribution
from bodycam_ros.evaluate.read_solved import LANDMARKS, LANDMARKS_TYPE, camera_topics
from bodycam_ros.evaluate.solved_recording import SolvedRecording
from bodycam_ros.evaluate.trajectory import interpolated
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.messages.tracks import landmark_matches
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording

Floats = NDArray[np.floating]


def reprojection_errors(solved: SolvedRecording, recording: Path) -> dict[str, Distribution]:
    """Camera -> distances [px] of its named tracks from their landmarks, seen from the solved pose.

    Outliers are among them: the median is the accuracy, the tail counts false names and slipped tracks.

    Args:
        solved: the body.
        recording: the bag that it was solved from.

    Raises:
        RecordingError: not a recording, or not of these cameras.
        LensError: the recording's intrinsics cannot be used.
    """
    poses = {record.camera: world_T_camera for record, world_T_camera in solved.solved_cameras()}
    with open_recording(recording) as cameras:
        models = {camera: cameras.camera_model(camera) for camera in poses if camera in cameras.cameras}
        if not models:
            raise RecordingError(
                f"{recording} has none of the cameras of {solved.path}: {', '.join(poses)}; it has "
                f"{', '.join(cameras.cameras)}"
            )
    errors: dict[str, list[Array]] = {camera: [] for camera in models}
    with BagFile(solved.path) as bag:
        topics = {t: c for t, c in camera_topics(bag, LANDMARKS, LANDMARKS_TYPE).items() if c in models}
        for topic, _, message in bag.messages(topics):
            camera = topics[topic]
            matches = landmark_matches(message, camera)
            at_ns = np.array([matches.stamp_ns])
            if solved.is_solved_at(at_ns).all():
                world_T_camera = interpolated(solved.stamps_ns, poses[camera], at_ns)[0]
                errors[camera].append(_errors(models[camera], world_T_camera, matches.points_world, matches.pixels))
    return {camera: Distribution.of(np.concatenate([np.zeros(0), *values])) for camera, values in errors.items()}


def _errors(model: CameraModel, world_T_camera: Array, points_world: Floats, pixels: Floats) -> Array:
    projected, _ = model.project(transform_points(inverse(world_T_camera), points_world.astype(np.float64)))
    errors: Array = np.linalg.norm(projected - pixels, axis=1)
    return errors
