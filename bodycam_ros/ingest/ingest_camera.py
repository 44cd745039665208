"""A camera that is to go into a bag: its video, its lens, and what its frames will be."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.camera_info import readout_time_from_yaml
from bodycam_ros.errors import BodycamError, LensError, RecordingError
from bodycam_ros.ingest.find_videos import CameraFiles
from bodycam_ros.recording.camera_video import CameraVideo

_NAME_OF_TOPIC = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class IngestCamera:
    """One camera.

    Attributes:
        video: what it recorded.
        lens: its intrinsics, of upright frames.
        readout_s: from the middle of the exposure of the first row to that of the last [s]; None: not given.
    """

    video: CameraVideo
    lens: CameraModel
    readout_s: float | None

    @property
    def name(self) -> str:
        """The camera's name."""
        return self.video.camera


def load_cameras(found: Sequence[CameraFiles], lens_folder: Path | None) -> tuple[list[IngestCamera], list[str]]:
    """Look at each camera's files and lens.

    Args:
        found: the files.
        lens_folder: where the lens YAMLs are; None: beside the videos.

    Returns:
        The cameras that can be used, and for each of the others what is wrong with it.
    """
    cameras, faults = [], []
    for files in found:
        try:
            cameras.append(_load(files, lens_folder))
        except BodycamError as error:
            faults.append(f"camera {files.camera}: left out: {error}")
    return cameras, faults


def open_video(files: CameraFiles) -> CameraVideo:
    """A camera's video.

    Raises:
        RecordingError: it cannot be read, or a topic cannot have its name.
    """
    if not _NAME_OF_TOPIC.fullmatch(files.camera):
        raise RecordingError(
            f"{files.paths[0]}: a topic cannot be named after it; rename it: letters, digits and underscores, "
            "beginning with a letter"
        )
    return CameraVideo.of_files(files.camera, files.paths)


def read_lens(files: CameraFiles, lens_folder: Path | None) -> tuple[CameraModel, float | None]:
    """A camera's lens and read-out time [s], None where that is not given.

    Raises:
        LensError: there is no lens YAML, or it cannot be used.
    """
    path = files.lens_path(lens_folder)
    return camera_from_yaml(path, files.camera), readout_time_from_yaml(path)


def _load(files: CameraFiles, lens_folder: Path | None) -> IngestCamera:
    video = open_video(files)
    lens, readout_s = read_lens(files, lens_folder)
    facts = video.facts
    if (lens.width, lens.height) != (facts.width, facts.height):
        turned = f" (turned by {facts.rotation_deg} deg to be upright)" if facts.rotation_deg else ""
        raise LensError(
            f"{files.lens_path(lens_folder)}: is for {lens.width} x {lens.height} pixels, but {video.path} has "
            f"{facts.width} x {facts.height}{turned}; calibrate the camera in the mode that it recorded in"
        )
    return IngestCamera(video, lens, readout_s)
