"""From a moving camera to a reference folder: photographs, and the lens that took them."""

import logging
import re
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_info_yaml import camera_info_yaml
from bodycam_ros.errors import RecordingError
from bodycam_ros.mapping.frame_choice import FrameChoiceSettings, choose_frames
from bodycam_ros.mapping.frame_motion import frame_motion
from bodycam_ros.mapping.moving_camera import Frame, MovingCamera
from bodycam_ros.mapping.photographs import CAMERA_FILE
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.mapping.steady_picture import steady_picture
from bodycam_ros.output_place import check_folder
from bodycam_ros.whole_file import failure_named, whole_folder

_LOG = logging.getLogger(__name__)

_JPEG_QUALITY = 95
_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
_PARTS = re.compile(rf"frame_\d{{6,}}\.(jpg|png)|{re.escape(CAMERA_FILE)}")


def keep_chosen_frames(
    source: MovingCamera, folder: Path, settings: FrameChoiceSettings, force: bool, progress: Progress
) -> None:
    """Write the sharp frames that a map needs into a reference folder, whole or not at all.

    The recording is read twice: first to see how it moves, then for the pictures, of which no more than one is in
    memory at a time. Where the read-out time of its rows is known, they are straightened by how the camera turned.

    Args:
        source: the recording.
        folder: to be.
        settings: which frames.
        force: replace an earlier folder of this kind.
        progress: shows the steps.

    Raises:
        MapError: the recording shows nothing, or hardly moves.
        LensError: the lens is for another size of image.
        OutputError: the folder cannot be written.
    """
    with progress.step("looking at frames", source.count) as advance:
        motion = frame_motion(source, settings.step_deg, advance)
    rows = set(choose_frames(motion, source.name, settings).tolist())
    with (
        whole_folder(folder, partial(check_frames_replaceable, force=force)) as unfinished,
        failure_named(folder),
        progress.step("keeping sharp frames", len(rows)) as advance,
        source.frames() as frames,
    ):
        unfinished.mkdir()
        (unfinished / CAMERA_FILE).write_text(camera_info_yaml(source.camera))
        last = max(rows)
        for row, frame in enumerate(frames):
            if row in rows:
                suffix, content = _straight(frame, source, motion.angular_velocity[row])
                (unfinished / f"frame_{row:06d}{suffix}").write_bytes(content)
                advance()
            if row == last:
                break
        else:
            raise RecordingError(f"{source.name}: ends at another frame when it is read again; is it being written?")
    _LOG.info("%s: %d of %d frames chosen", source.name, len(rows), len(motion.seconds))


def _straight(frame: Frame, source: MovingCamera, angular_velocity: NDArray[np.float64]) -> tuple[str, bytes]:
    """Suffix and content of the frame's file, without what reading out its rows did to it."""
    suffix, content = frame.file()
    if not any(source.readout_s) or not angular_velocity.any():
        return suffix, content
    pixels = np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), _AS_STORED), np.uint8)
    straight = steady_picture(pixels, source.camera, angular_velocity, source.readout_s)
    return ".jpg", cv2.imencode(".jpg", straight, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


def check_frames_replaceable(path: Path, force: bool) -> None:
    """Refuse to replace what is there, unless ``force`` is given and it is a folder of frames.

    Raises:
        OutputError: so it is.
    """
    if path.exists():
        check_folder(path, force, CAMERA_FILE, _PARTS, "folder of chosen frames")
