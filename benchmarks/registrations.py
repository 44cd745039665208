"""Registrations of a recording, for benchmarks of the solver."""

from collections.abc import Mapping
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.replaying.camera_worker import RegistrationTask
from bodycam_ros.replaying.front_end import registered_images


def registrations(
    recording_path: Path, map_path: Path, body: BodyModel, settings: PipelineSettings, jobs: int
) -> tuple[Mapping[str, CameraModel], list[LandmarkMatches]]:
    """Models of the body's cameras by name, and what each image of them was registered to, in order of time.

    Raises:
        BodycamError: recording or map cannot be read.
        MapError: no image could be registered.
    """
    with open_recording(recording_path) as recording:
        cameras = {name: recording.camera_model(name) for name in recording.cameras if name in body.mounts}
    images = registered_images(RegistrationTask(recording_path, map_path, settings), cameras, jobs)
    registered = [image.matches for image in images]
    if not any(matches.world_T_camera is not None for matches in registered):
        raise MapError(f"no image of {recording_path} could be registered in {map_path}; check that they fit")
    return cameras, registered
