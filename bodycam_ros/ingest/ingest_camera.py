"""A camera to be ingested: its video or images, its lens, and the size of its frames in the bag."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.camera_info import readout_time_from_yaml, scaled_camera
from bodycam_ros.errors import BodycamError, LensError, RecordingError
from bodycam_ros.files.shown import other_than
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.ingest.camera_remarks import Causes, left_out_lines
from bodycam_ros.ingest.find_videos import CameraFiles, find_videos
from bodycam_ros.recording.camera_video import CameraVideo
from bodycam_ros.recording.image_folder import ImageFolder
from bodycam_ros.recording.video_file import DecodedFrame


@dataclass(frozen=True)
class IngestCamera:
    """One camera, or a part of its recording after a gap.

    Attributes:
        topic_name: the camera in the names of topics.
        video: what it recorded.
        lens: its intrinsics, of upright frames in the size recorded.
        readout_s: from the middle of the exposure of the first row to that of the last [s]; None: not given.
        scale: size of frames in the bag, as a share of the size recorded.
    """

    topic_name: str
    video: CameraVideo | ImageFolder
    lens: CameraModel
    readout_s: float | None
    scale: float = 1.0

    @property
    def name(self) -> str:
        """The camera's name, with the number of a later part: ``head, part 2``."""
        return self.video.camera

    @property
    def written_lens(self) -> CameraModel:
        """The lens of the frames in the bag."""
        return self.lens if self.scale == 1.0 else scaled_camera(self.lens, self.scale)

    def grey_images(self, ended: Event) -> Iterator[tuple[float, NDArray[np.uint8]]]:
        """Media time [s] and grey pixels (H, W), upright, of the frames until the event is set."""
        rotation_deg = self.video.facts.rotation_deg
        for media_s, frame in self.video.frames(threads=1):
            if ended.is_set():
                return
            yield media_s, DecodedFrame(frame, rotation_deg).grey()

    @property
    def is_copied(self) -> bool:
        """Whether frames can go into the bag as they are."""
        return self.scale == 1.0 and (isinstance(self.video, ImageFolder) or self.video.facts.is_upright_annex_b)


def find_cameras(
    given: Sequence[Path], lenses: Path | None, rate_hz: float | None = None, scale: float = 1.0
) -> tuple[list[IngestCamera], dict[str, str]]:
    """The cameras among files and folders, by name, and why others cannot be used: camera -> cause.

    Args:
        given: video files, and folders with videos or images.
        lenses: where the lens YAMLs are, or a file of static cameras; None: beside the videos.
        rate_hz: of images that are not named by their stamps.
        scale: see ``IngestCamera``.

    Raises:
        RecordingError: something given does not exist, a rate is given for videos, or no camera can be used.
    """
    found, causes = find_videos(given, lenses)
    if lenses is not None and not lenses.exists():
        raise RecordingError(
            f"{lenses}: does not exist; expected the folder of the lens YAMLs, or a file of static cameras"
        )
    check_rate(found, rate_hz)
    cameras: list[IngestCamera] = []
    for files in found:
        try:
            cameras += load_camera(files, lenses, rate_hz, scale)
        except BodycamError as error:
            causes[files.camera] = error.cause
    check_any(cameras, causes)
    return cameras, causes


def check_rate(found: Sequence[CameraFiles], rate_hz: float | None) -> None:
    """Refuse a rate of images for videos alone."""
    if rate_hz is not None and found and not any(files.are_images for files in found):
        raise RecordingError("--rate is for folders with images; videos have the times of their frames: remove it")


def check_any(cameras: Sequence[IngestCamera], causes: Causes) -> None:
    """Refuse none, and one that is left of several; ``causes``: camera that is left out -> why."""
    if len(cameras) > 1 or (cameras and not causes):
        return
    left = f"only camera {cameras[0].name} of those given can be used" if cameras else "no camera can be used"
    raise RecordingError("\n".join([left, *left_out_lines(causes)]))


def read_lens(files: CameraFiles, lenses: Path | None) -> tuple[CameraModel, float | None, Path]:
    """A camera's lens, its read-out time [s], None where that is not given, and the file that has them.

    Args:
        files: of the camera.
        lenses: folder with lens YAMLs, or a file of static cameras, ours or another program's; None: beside the files.

    Raises:
        LensError: there is no lens of that camera, or it cannot be used.
        StaticCameraError: the file of static cameras cannot be used.
    """
    if lenses is None or not lenses.is_file():
        path = files.lens_path(lenses)
        return camera_from_yaml(path, files.camera), readout_time_from_yaml(path), path
    static_cameras = read_static_cameras(lenses)
    if files.camera not in static_cameras:
        raise LensError(f"{lenses}: has no camera {files.camera}; {other_than(files.camera, static_cameras)}")
    return static_cameras[files.camera].camera, None, lenses


def open_files(files: CameraFiles, rate_hz: float | None = None) -> CameraVideo | ImageFolder:
    """What a camera recorded, by its header and its index; ``rate_hz``: see ``find_cameras``.

    Raises:
        RecordingError: its video or images cannot be used.
    """
    if files.are_images:
        return ImageFolder.from_files(files.camera, files.paths, rate_hz)
    return CameraVideo.of_files(files.camera, files.paths)


def load_camera(
    files: CameraFiles, lenses: Path | None, rate_hz: float | None = None, scale: float = 1.0
) -> list[IngestCamera]:
    """One camera; several where its recording has gaps, one for each part.

    Args:
        files: of the camera.
        lenses, rate_hz, scale: see ``find_cameras``.

    Raises:
        LensError, StaticCameraError: its lens is missing, cannot be used, or is for frames of another size.
        RecordingError: its video or images cannot be used, or are stabilised.
    """
    video = open_files(files, rate_hz)
    lens, readout_s, lens_path = read_lens(files, lenses)
    video.facts.check_size(video.path, lens, lens_path)
    if isinstance(video, CameraVideo) and (reason := video.stabilisation()):
        raise RecordingError(
            f"{video.path}: was recorded with electronic stabilisation ({reason}), which moves and bends each image, "
            "so that no lens fits; switch it off and record again"
        )
    parts = video.parts() if isinstance(video, CameraVideo) else [video]
    return [IngestCamera(files.camera, part, lens, readout_s, scale) for part in parts]
