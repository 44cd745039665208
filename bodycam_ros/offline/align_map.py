"""Images of body cameras registered in the map that is made of some of them: they give its scale and vertical."""

from collections.abc import Collection
from pathlib import Path
from tempfile import gettempdir

import numpy as np

from bodycam_ros.inertial.map_alignment import RegisteredPoses
from bodycam_ros.offline.camera_worker import RegistrationTask
from bodycam_ros.offline.front_end import registered_images
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.whole_file import scratch_folder


def registered_poses(
    reference_map: ReferenceMap, cameras: Collection[str], recording_path: Path, jobs: int
) -> dict[str, RegisteredPoses]:
    """Camera -> its images that are registered in a map, whose unit may be wrong by a third.

    Args:
        reference_map: the map.
        cameras: of the recording.
        recording_path: with the images.
        jobs: processes.

    Raises:
        RecordingError: the recording cannot be read.
    """
    with open_recording(recording_path) as recording:
        models = {camera: recording.camera_model(camera) for camera in cameras}
    found: dict[str, list[LandmarkMatches]] = {camera: [] for camera in models}
    with scratch_folder(Path(gettempdir())) as scratch:
        reference_map.save(scratch / "map")
        task = RegistrationTask(recording_path, scratch / "map", PipelineSettings(), with_messages=False)
        for image in registered_images(task, models, jobs):
            if image.matches.world_T_camera is not None:
                found[image.camera].append(image.matches)
    return {
        camera: (
            np.array([each.stamp_ns for each in own], np.int64),
            np.array([each.world_T_camera for each in own], np.float64).reshape(-1, 4, 4),
        )
        for camera, own in found.items()
    }
