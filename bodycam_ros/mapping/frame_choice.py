"""Choice of sharp frames of moving cameras, carried or on the body, as photographs of a map."""

import logging
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError, RecordingError
from bodycam_ros.mapping.frame_motion import FrameMotion, measure_motion, steady_picture
from bodycam_ros.mapping.map_settings import FrameSettings
from bodycam_ros.mapping.moving_camera import Frame, MovingCamera
from bodycam_ros.mapping.photographs import FrameOrigin, Photographs
from bodycam_ros.progress import Progress, in_parallel
from bodycam_ros.whole_file import failure_named

_LOG = logging.getLogger(__name__)

Rows = NDArray[np.int64]

_FEWEST = 60  # frames of all cameras: of a short recording frames are taken closer to each other
_FEWEST_OF_CAMERA = 8
_MIN_STEP_DEG = 3.0  # between frames of a camera: closer ones show the same from the same place
_MIN_SHARPNESS = 0.7  # relative to the better frames nearby; blur over 5 of 1280 px gives 0.78, over 9 px 0.6
_NEARBY_S = 1.0  # before and after: the scene is still much the same
_SHARP_PERCENTILE = 80
_MIN_USUAL = 0.25  # of the sharpness of the whole: seconds of blur are no reference, but bare walls may be
_MIN_GAP = 0.3  # of a step, so that no two frames are next to each other
_OFF_CENTRE = 0.2  # of its sharpness that a frame may lose by being half a step late

_JPEG_QUALITY = 95
_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def keep_sharp_frames(
    sources: Mapping[str, MovingCamera],
    folder: Path,
    name: str,
    settings: FrameSettings,
    workers: int,
    progress: Progress,
    board_path: Path | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> Photographs:
    """Write the sharp frames that a map needs into a folder.

    Recordings are read twice: first for their motion, then for the pictures. Where the read-out time of its rows is
    known, a picture is straightened by the camera's rotation.

    Args:
        sources: camera -> its frames.
        folder: that is there.
        name: of the recording.
        settings: which frames.
        workers: threads.
        progress: shows the steps.
        board_path: description of the board, if there is one.
        pairs: cameras of which simultaneous frames are wanted.

    Raises:
        MapError: a recording shows nothing, or hardly moves.
        LensError: a lens is for another size of image.
        OutputError: the folder cannot be written.
    """
    with progress.step("analysing frames", sum(source.count for source in sources.values())) as advance:
        measured = in_parallel(partial(measure_motion, on_frame=advance), sources.values(), workers)
        motions = dict(zip(sources, measured, strict=True))
    rows = choose_frames(motions, name, settings)
    for first, second in pairs:
        nearest = np.abs(motions[second].seconds[None] - motions[first].seconds[rows[first], None]).argmin(axis=1)
        rows[second] = np.union1d(rows[second], nearest)
    names, origins = {}, {}
    count = sum(map(len, rows.values()))
    with failure_named(folder), progress.step("writing sharp frames", count) as advance:
        for camera, source in sources.items():
            prefix = "frame" if len(sources) == 1 else camera.replace("/", "_")
            wanted = set(rows[camera].tolist())
            with source.frames() as frames:
                for row, frame in enumerate(frames):
                    if row in wanted:
                        suffix, content = _straightened(frame, source, motions[camera].angular_velocity[row])
                        file = f"{prefix}_{row:06d}{suffix}"
                        (folder / file).write_bytes(content)
                        names[file], origins[file] = source.camera, FrameOrigin(camera, frame.seconds)
                        advance()
                    if row == max(wanted):
                        break
                else:
                    raise RecordingError(f"{source.name}: ends earlier when it is read again; is it being written?")
    _LOG.info("%s: %d frames of %d cameras chosen", name, len(names), len(sources))
    return Photographs(folder, name, tuple(folder / file for file in sorted(names)), names, board_path, origins)


def choose_frames(motions: Mapping[str, FrameMotion], name: str, settings: FrameSettings) -> dict[str, Rows]:
    """Rows (C,) of the frames of each camera, ascending: evenly spread over the change of view, and sharp.

    Args:
        motions: of all frames of each camera.
        name: of the recording, for messages.
        settings: how many.

    Raises:
        MapError: the view hardly changes.
    """
    lengths = {camera: float(motion.path_deg[-1] - motion.path_deg[0]) for camera, motion in motions.items()}
    total = sum(lengths.values())
    most = max(settings.most, 2)
    step_deg = total / np.clip(total / settings.step_deg, min(_FEWEST, most), most)
    fewest = min(max(_FEWEST // len(motions), _FEWEST_OF_CAMERA), max(most // len(motions), 2))
    rows = {}
    for camera, motion in motions.items():
        wanted = max(round(lengths[camera] / max(step_deg, 1e-9)), fewest)
        chosen = _sharp_rows(motion, max(lengths[camera] / max(1, wanted - 1), _MIN_STEP_DEG))
        # A camera that hardly moved gives its sharpest frame.
        rows[camera] = chosen if len(chosen) > 1 else np.argmax(motion.sharpness, keepdims=True).astype(np.int64)
    count = sum(map(len, rows.values()))
    if count < 2:
        raise MapError(
            f"{name}: the view changes by {total:.0f} deg from the first frame to the last, which makes {count} "
            "photographs; a map needs a walk through the place that shows it from many sides, or a range of motion"
        )
    return rows


def _sharp_rows(motion: FrameMotion, step_deg: float) -> Rows:
    relative = motion.sharpness / np.maximum(_usual_sharpness(motion), 1e-9)
    chosen: list[int] = []
    for due_deg in np.arange(motion.path_deg[0], motion.path_deg[-1] + 0.5 * step_deg, step_deg):
        least_deg = due_deg - 0.5 * step_deg
        if chosen:
            least_deg = max(least_deg, float(motion.path_deg[chosen[-1]]) + _MIN_GAP * step_deg)
        first, end = np.searchsorted(motion.path_deg, [least_deg, due_deg + 0.5 * step_deg])
        # Many frames are due while the camera stands still, perhaps none where it is fast.
        near = np.arange(first, end)[relative[first:end] >= _MIN_SHARPNESS]
        if len(near):
            late = np.abs(motion.path_deg[near] - due_deg) / (0.5 * step_deg)
            chosen.append(int(near[np.argmax(relative[near] - _OFF_CENTRE * late)]))
    return np.array(chosen, np.int64)


def _usual_sharpness(motion: FrameMotion) -> NDArray[np.float64]:
    """(N,) sharpness of the better frames around each, or a share of that of the whole if it is more."""
    from scipy.ndimage import percentile_filter

    duration_s = float(motion.seconds[-1] - motion.seconds[0])
    reach = round(_NEARBY_S * (len(motion.seconds) - 1) / duration_s) if duration_s > 0.0 else 0
    usual: NDArray[np.float64] = percentile_filter(
        motion.sharpness, _SHARP_PERCENTILE, size=2 * max(1, reach) + 1, mode="mirror"
    )
    return np.maximum(usual, _MIN_USUAL * np.percentile(motion.sharpness, _SHARP_PERCENTILE))


def _straightened(frame: Frame, source: MovingCamera, angular_velocity: NDArray[np.float64]) -> tuple[str, bytes]:
    """Suffix and content of the frame's file, without the effect of its read-out."""
    suffix, content = frame.file()
    if not any(source.readout_s) or not angular_velocity.any():
        return suffix, content
    pixels = np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), _AS_STORED), np.uint8)
    straight = steady_picture(pixels, source.camera, angular_velocity, source.readout_s)
    return ".jpg", cv2.imencode(".jpg", straight, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()
