"""Scale and vertical of a map of body cameras, from their inertial sensors in the same recording."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import gettempdir

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.map_alignment import InertialAlignment, align_to_gravity
from bodycam_ros.offline.camera_worker import RegistrationTask
from bodycam_ros.offline.front_end import register_matches
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.whole_file import scratch_folder


def align_map(
    reference_map: ReferenceMap,
    recording_path: Path,
    imus: Mapping[str, ImuSamples],
    jobs: int,
) -> InertialAlignment:
    """Register all images of the cameras with sensors in a map, and find its scale and vertical.

    Args:
        reference_map: whose unit may be wrong by a third.
        recording_path: of the images.
        imus: camera -> samples of its sensor.
        jobs: processes.

    Raises:
        MapError: as of ``align_to_gravity``.
        RecordingError: the recording cannot be read.
    """
    with open_recording(recording_path) as recording:
        models = {camera: recording.camera_model(camera) for camera in recording.cameras if camera in imus}
    stamps_ns: dict[str, list[int]] = {camera: [] for camera in models}
    poses: dict[str, list[NDArray[np.float64]]] = {camera: [] for camera in models}
    with scratch_folder(Path(gettempdir())) as scratch:
        reference_map.save(scratch / "map")
        task = RegistrationTask(recording_path, scratch / "map", PipelineSettings(), with_messages=False)
        for matches in register_matches(task, models, jobs):
            if matches.world_T_camera is not None:
                stamps_ns[matches.camera].append(matches.stamp_ns)
                poses[matches.camera].append(matches.world_T_camera)
    registered = {
        camera: (np.array(stamps_ns[camera], np.int64), np.array(poses[camera], np.float64).reshape(-1, 4, 4))
        for camera in models
    }
    return align_to_gravity(registered, imus)
