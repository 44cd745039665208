"""The camera that a video was taken with."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_yaml
from bodycam_ros.camera.camera_info import readout_time_from_yaml
from bodycam_ros.errors import LensError
from bodycam_ros.video.camera_video import CameraVideo
from bodycam_ros.video.upright_frames import jpegs
from bodycam_ros.video.video_frame import grey_pixels

if TYPE_CHECKING:
    from av import VideoFrame

_DIRECTIONS = {0: (0.0, 1.0), 90: (1.0, 0.0), 180: (0.0, -1.0), 270: (-1.0, 0.0)}
"""In which an upright frame is read out, to the right and down, by how much it was turned counter-clockwise."""


@dataclass(frozen=True)
class _VideoFrame:
    """A frame as the decoder gave it, and by how much it has to be turned counter-clockwise."""

    seconds: float
    decoded: "VideoFrame"
    rotation_deg: int

    def grey(self) -> NDArray[np.uint8]:
        return np.ascontiguousarray(np.rot90(grey_pixels(self.decoded), self.rotation_deg // 90))

    def file(self) -> tuple[str, bytes]:
        ((_, jpeg),) = jpegs([(self.seconds, self.decoded)], self.rotation_deg)
        return ".jpg", jpeg


class VideoCamera:
    """A ``MovingCamera`` that is a video file; frames are turned upright, as ``bodycam ingest`` turns them.

    Args:
        path: MP4 or the like.
        lens_path: camera_info YAML of upright frames; None: beside the video, named after it.

    Raises:
        RecordingError: the file is no video that can be read.
        LensError: there is no lens, or it is for another size of image.
    """

    def __init__(self, path: Path, lens_path: Path | None) -> None:
        self._video = CameraVideo.of_files(path.stem, [path])
        facts = self._video.facts
        self._rotation_deg = facts.rotation_deg
        self.name = path.name
        self.count = facts.frames or round(facts.rate_hz * facts.duration_s)
        lens_path = lens_path or path.with_suffix(".yaml")
        self.camera = _lens(path, lens_path)
        readout_s, (right, down) = readout_time_from_yaml(lens_path) or 0.0, _DIRECTIONS[facts.rotation_deg]
        self.readout_s = (right * readout_s, down * readout_s)
        if (self.camera.width, self.camera.height) != (facts.width, facts.height):
            turned = f" (turned by {facts.rotation_deg} deg to be upright)" if facts.rotation_deg else ""
            raise LensError(
                f"{lens_path}: is for {self.camera.width} x {self.camera.height} pixels, "
                f"but {path} has {facts.width} x {facts.height}{turned}; calibrate the camera in the mode that it "
                "recorded in"
            )

    @contextmanager
    def frames(self) -> Iterator[Iterator[_VideoFrame]]:
        """The frames that can be decoded, in order of time."""
        yield (_VideoFrame(media_s, frame, self._rotation_deg) for media_s, frame in self._video.frames())


def _lens(video: Path, path: Path) -> CameraModel:
    if not path.exists():
        raise LensError(
            f"there is no lens YAML for {video}; say with --camera where it is (camera_info YAML, as ROS calibration "
            f"tools write it), or put it at {path}"
        )
    return camera_from_yaml(path)
