"""Which frames of a camera that is carried through a place become photographs of a map."""

import logging
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.camera_info import camera_info_yaml
from bodycam_ros.errors import MapError, RecordingError
from bodycam_ros.mapping.frame_motion import Frame, FrameMotion, MovingCamera, frame_motion, steady_picture
from bodycam_ros.mapping.photographs import CAMERA_FILE
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.output_place import check_folder
from bodycam_ros.settings import setting
from bodycam_ros.whole_file import failure_named, whole_folder

_LOG = logging.getLogger(__name__)

_NEIGHBOURS_S = 1.0  # before and after: what is seen is still much the same
_SHARP_PERCENTILE = 80
_POOREST = 0.25  # of the sharpness of the whole; seconds of blur are no measure for each other, but bare walls may be
_APART = 0.3  # of a step, so that no two are next to each other
_OFF_CENTRE = 0.2  # of its sharpness is what a frame may lose by coming half a step late


@dataclass(frozen=True)
class FrameChoiceSettings:
    """Which frames of a video or bag become photographs."""

    step_deg: float = setting(
        10.0,
        unit="deg",
        limits=(0.5, 60.0),
        reason="by which the view changes between two frames, by turning or by going past things; a sixth of an "
        "ordinary lens' view",
    )
    fewest: int = setting(
        60, unit="frames", limits=(2, 2000), reason="of a short recording frames are taken closer to each other"
    )
    most: int = setting(
        150, unit="frames", limits=(2, 2000), reason="of a long one farther apart: time grows faster than their number"
    )
    min_step_deg: float = setting(
        3.0, unit="deg", limits=(0.1, 60.0), reason="frames that are closer show the same from the same place"
    )
    max_step_deg: float = setting(
        25.0, unit="deg", limits=(1.0, 90.0), reason="farther apart frames may have too little in common: a warning"
    )
    min_sharpness: float = setting(
        0.7,
        limits=(0.0, 1.0),
        reason="least contrast of fine detail against the better frames within a second; photographs of the sample "
        "that are blurred over 5 of 1280 px have 0.78, over 9 px 0.6",
    )


def choose_frames(motion: FrameMotion, name: str, settings: FrameChoiceSettings) -> NDArray[np.int64]:
    """Rows (C,) of the frames to take, ascending: evenly spread over the change of view, and sharp for their time.

    Args:
        motion: of all frames.
        name: of the recording, for messages.
        settings: how many.

    Raises:
        MapError: the view hardly changes.
    """
    length_deg = float(motion.path_deg[-1] - motion.path_deg[0])
    wanted = int(np.clip(round(length_deg / settings.step_deg), settings.fewest, max(settings.fewest, settings.most)))
    step_deg = max(length_deg / max(1, wanted - 1), settings.min_step_deg)
    relative = motion.sharpness / np.maximum(_usual_sharpness(motion), 1e-9)
    sharp = relative >= settings.min_sharpness
    chosen: list[int] = []
    for due_deg in np.arange(motion.path_deg[0], motion.path_deg[-1] + 0.5 * step_deg, step_deg):
        least_deg = due_deg - 0.5 * step_deg
        if chosen:
            least_deg = max(least_deg, float(motion.path_deg[chosen[-1]]) + _APART * step_deg)
        first, end = np.searchsorted(motion.path_deg, [least_deg, due_deg + 0.5 * step_deg])
        # While the camera stands still many frames are due at the same place; where it is fast perhaps none.
        near = np.arange(first, end)[sharp[first:end]]
        if len(near):
            late = np.abs(motion.path_deg[near] - due_deg) / (0.5 * step_deg)
            chosen.append(int(near[np.argmax(relative[near] - _OFF_CENTRE * late)]))
    rows = np.array(chosen, np.int64)
    if len(rows) < 2:
        raise MapError(
            f"{name}: the view changes by {length_deg:.0f} deg from the first frame to the last, which makes "
            f"{len(rows)} photographs; a map needs a walk through the place that sees it from many sides"
        )
    _warn(name, step_deg, rows, motion, settings)
    return rows


def _usual_sharpness(motion: FrameMotion) -> NDArray[np.float64]:
    """(N,) sharpness of the better frames around each, or of a poor part of the whole if that is more."""
    from scipy.ndimage import percentile_filter

    duration_s = float(motion.seconds[-1] - motion.seconds[0])
    reach = round(_NEIGHBOURS_S * (len(motion.seconds) - 1) / duration_s) if duration_s > 0.0 else 0
    usual: NDArray[np.float64] = percentile_filter(
        motion.sharpness, _SHARP_PERCENTILE, size=2 * max(1, reach) + 1, mode="mirror"
    )
    return np.maximum(usual, _POOREST * np.percentile(motion.sharpness, _SHARP_PERCENTILE))


def _warn(
    name: str, step_deg: float, rows: NDArray[np.int64], motion: FrameMotion, settings: FrameChoiceSettings
) -> None:
    if step_deg > settings.max_step_deg:
        _LOG.warning(
            "%s: is so long that its %d frames are %.0f deg apart, and may not hang together; raise frames.most, or "
            "give a shorter recording",
            *(name, len(rows), step_deg),
        )
    widest = float(np.diff(motion.path_deg[rows]).max())
    if widest > max(2.0 * step_deg, settings.max_step_deg):
        at = rows[int(np.argmax(np.diff(motion.path_deg[rows])))]
        _LOG.warning(
            "%s: after %.1f s the view changes by %.0f deg without a sharp frame; the map may fall apart there. Walk "
            "and turn more slowly, in more light",
            *(name, motion.seconds[at] - motion.seconds[0], widest),
        )


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
