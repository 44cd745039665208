"""Sharp frames of moving cameras, carried or on the body, as photographs of a map."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.mapping.moving_camera import Frame, MovingCamera
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.steady_picture import camera_turn, steady_picture
from bodycam_ros.progress import Progress, in_parallel
from bodycam_ros.whole_file import failure_named

_LEAST_PART_S = 0.3  # closer frames show the same from the same place
_BEYOND_LAST = 1.001  # the last frame belongs to the last part
_LEAST_STEP_S = 1e-3  # between two frames
_SHARP_WIDTH = 1280  # [px] blur over two pixels of a photograph must show
_JPEG_QUALITY = 95
_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def keep_sharp_frames(
    sources: Mapping[str, MovingCamera],
    folder: Path,
    name: str,
    most: int,
    workers: int,
    progress: Progress,
    board_path: Path | None = None,
) -> Photographs:
    """Write the sharpest frame of each of some equal parts of every recording into a folder.

    Where the read-out time of its rows is known, a picture is straightened by the camera's rotation.

    Args:
        sources: camera -> its frames.
        folder: that is there.
        name: of the recording.
        most: frames of all cameras together.
        workers: threads.
        progress: shows the step.
        board_path: description of the board, if there is one.

    Raises:
        MapError: no frame of a recording shows anything, or there are fewer than two parts.
        LensError: a lens is for another size of image.
        OutputError: the folder cannot be written.
    """
    each = max(most // len(sources), 2)
    with failure_named(folder), progress.step("choosing sharp frames", sum(s.count for s in sources.values())) as step:

        def write(camera: str) -> list[str]:
            source, names = sources[camera], []
            prefix = "frame" if len(sources) == 1 else camera.replace("/", "_")
            part_s = max(_BEYOND_LAST * source.duration_s / each, _LEAST_PART_S)
            for found in _sharpest(source, part_s, step):
                suffix, content = found.file(source)
                names.append(f"{prefix}_{found.row:06d}{suffix}")
                (folder / names[-1]).write_bytes(content)
            if not names:
                raise MapError(f"{source.name}: none of its {source.count} frames shows anything; give another one")
            return names

        written = dict(zip(sources, in_parallel(write, sources, workers), strict=True))
    camera_of_name = {file: sources[camera].camera for camera, names in written.items() for file in names}
    if len(camera_of_name) < 2:
        raise MapError(f"{name}: lasts for one photograph; a map needs a walk through the place, or a range of motion")
    return Photographs(
        folder, name, tuple(folder / file for file in sorted(camera_of_name)), camera_of_name, board_path
    )


@dataclass(frozen=True)
class _Candidate:
    """A frame, its number and sharpness, its grey pixels, and the frame before it with those."""

    frame: Frame
    row: int
    sharpness: float
    grey: NDArray[np.uint8]
    before: tuple[Frame, NDArray[np.uint8]] | None

    def file(self, source: MovingCamera) -> tuple[str, bytes]:
        """Suffix and content of its file; where the read-out time is known without its effect."""
        suffix, content = self.frame.file()
        if not any(source.readout_s) or self.before is None:
            return suffix, content
        before, grey_before = self.before
        turn = camera_turn(source.camera, grey_before, self.grey)
        velocity = turn / max(self.frame.seconds - before.seconds, _LEAST_STEP_S)
        pixels = np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), _AS_STORED), np.uint8)
        straight = steady_picture(pixels, source.camera, velocity, source.readout_s)
        return ".jpg", cv2.imencode(".jpg", straight, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


def _sharpest(source: MovingCamera, part_s: float, on_frame: Callable[[], None]) -> Iterator[_Candidate]:
    """The sharpest frame of each part of so many seconds; none of a part that shows nothing."""
    best: _Candidate | None = None
    before: tuple[Frame, NDArray[np.uint8]] | None = None
    start_s, part = 0.0, 0
    with source.frames() as frames:
        for row, frame in enumerate(frames):
            on_frame()
            start_s = start_s if row else frame.seconds
            if (number := int((frame.seconds - start_s) / part_s)) > part:
                if best is not None:
                    yield best
                best, part = None, number
            try:
                grey = frame.grey()
            except RecordingError:
                continue
            camera = source.camera
            if grey.shape != (camera.height, camera.width):
                raise LensError(
                    f"{source.name}: its images have {grey.shape[1]} x {grey.shape[0]} pixels, but its intrinsics are "
                    f"for {camera.width} x {camera.height}; give the calibration of this mode with --camera"
                )
            sharpness = _sharpness(grey)
            if sharpness > (0.0 if best is None else best.sharpness):
                best = _Candidate(frame, row, sharpness, grey, before)
            before = frame, grey
    if best is not None:
        yield best


def _sharpness(grey: NDArray[np.uint8]) -> float:
    """Root of the smaller eigenvalue of the mean structure tensor: motion blur removes detail in one direction."""
    if (scale := _SHARP_WIDTH / grey.shape[1]) < 1.0:
        grey = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1), cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1)
    xx, yy, xy = (float(np.mean(product)) for product in (across * across, down * down, across * down))
    return float(np.sqrt(max(0.0, 0.5 * (xx + yy - np.hypot(xx - yy, 2.0 * xy)))))
