"""Sharp frames of moving cameras, carried or on the body, as photographs of a map."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, groupby
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.files.distinct_names import distinct_names
from bodycam_ros.files.whole_file import failure_named
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.moving_camera import MovingCamera, picture_file
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.progress import Progress, in_parallel
from bodycam_ros.registration.pose_fit import turned_pixels
from bodycam_ros.tracking.angular_speed import angular_speed

_LEAST_PART_S = 0.3  # closer frames show the same from the same place
_BEYOND_LAST = 1.001  # the last frame belongs to the last part
_SHARP_WIDTH = 1280  # [px] blur over two pixels of a photograph must show
_JPEG_QUALITY = 95
_ROWS_AT_ONCE = 200  # bounds the memory that a large picture takes
_ITERATIONS = 2
_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def keep_sharp_frames(
    sources: Mapping[str, MovingCamera],
    folder: Path,
    name: str,
    most: int,
    workers: int,
    progress: Progress,
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

    Raises:
        MapError: no frame of a recording shows anything, or there are fewer than two parts.
        LensError: a lens is for another size of image.
        OutputError: the folder cannot be written.
    """
    each = max(most // len(sources), 2)
    prefixes = distinct_names(sources, lambda camera: camera.replace("/", "_"))
    with failure_named(folder), progress.step("choosing sharp frames", sum(s.count for s in sources.values())) as step:

        def write(camera: str) -> list[str]:
            source, written = sources[camera], []
            part_s = max(_BEYOND_LAST * source.duration_s / each, _LEAST_PART_S)
            prefix = "frame" if len(sources) == 1 else prefixes[camera]
            for candidate in _sharpest(_candidates(source, step), part_s):
                suffix, content = candidate.file(source)
                written.append(f"{prefix}_{candidate.row:06d}{suffix}")
                (folder / written[-1]).write_bytes(content)
            if not written:
                raise MapError(f"{source.name}: none of {source.count} frames shows anything; give another recording")
            return written

        camera_of_name = {
            file: sources[camera].camera
            for camera, written in zip(sources, in_parallel(write, sources, workers), strict=True)
            for file in written
        }
    if len(camera_of_name) < 2:
        raise MapError(f"{name}: lasts for one photograph; a map needs a walk through the place, or a range of motion")
    return Photographs(folder, name, tuple(folder / file for file in sorted(camera_of_name)), camera_of_name)


@dataclass(frozen=True)
class _Candidate:
    """A frame, its number and sharpness, its grey pixels, and the frame before it with those."""

    frame: CameraImage
    row: int
    sharpness: float
    grey: NDArray[np.uint8]
    before: tuple[CameraImage, NDArray[np.uint8]] | None

    @property
    def seconds(self) -> float:
        return 1e-9 * self.frame.stamp_ns

    def file(self, source: MovingCamera) -> tuple[str, bytes]:
        """Suffix and content of its file; where the read-out time is known without its effect."""
        suffix, content = picture_file(self.frame)
        if not any(source.readout_s) or self.before is None:
            return suffix, content
        before, grey_before = self.before
        pictures = (1e-9 * before.stamp_ns, grey_before), (self.seconds, self.grey)
        velocity = np.nansum(angular_speed(source.camera, pictures).omega, axis=0)
        pixels = np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), _AS_STORED), np.uint8)
        straight = steady_picture(pixels, source.camera, velocity, source.readout_s)
        return ".jpg", cv2.imencode(".jpg", straight, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


def _sharpest(candidates: Iterator[_Candidate], part_s: float) -> Iterator[_Candidate]:
    """The sharpest frame of each part of so many seconds; none of a part that shows nothing."""
    if (first := next(candidates, None)) is not None:
        frames = chain([first], candidates)
        for _, part in groupby(frames, lambda each: int((each.seconds - first.seconds) / part_s)):
            yield max(part, key=lambda each: each.sharpness)


def _candidates(source: MovingCamera, on_frame: Callable[[], None]) -> Iterator[_Candidate]:
    """The frames of a camera that can be decoded and show something."""
    before: tuple[CameraImage, NDArray[np.uint8]] | None = None
    camera = source.camera
    with source.frames() as frames:
        for row, frame in enumerate(frames):
            on_frame()
            try:
                grey = decode_grey(frame)
            except RecordingError:
                continue
            if grey.shape != (camera.height, camera.width):
                raise LensError(
                    f"{source.name}: its images have {grey.shape[1]} x {grey.shape[0]} pixels, but its intrinsics are "
                    f"for {camera.width} x {camera.height}; give the calibration of this mode with --camera"
                )
            if (detail := sharpness(grey)) > 0.0:
                yield _Candidate(frame, row, detail, grey, before)
            before = frame, grey


def sharpness(grey: NDArray[np.uint8]) -> float:
    """Root of the smaller eigenvalue of the mean structure tensor: motion blur removes detail in one direction."""
    if (scale := _SHARP_WIDTH / grey.shape[1]) < 1.0:
        grey = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1), cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1)
    xx, yy, xy = (float(np.mean(product)) for product in (across * across, down * down, across * down))
    return float(np.sqrt(max(0.0, 0.5 * (xx + yy - np.hypot(xx - yy, 2.0 * xy)))))


def steady_picture(
    picture: NDArray[np.uint8], camera: CameraModel, angular_velocity: Array, readout_s: tuple[float, float]
) -> NDArray[np.uint8]:
    """Undo the effect of the camera's rotation during read-out; that of its translation is a tenth of it.

    Args:
        picture: (H, W) or (H, W, 3) pixels.
        camera: its lens.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_s: delay of the right border against the left, and of the lower against the upper [s].
    """
    source = np.empty((camera.height, camera.width, 2), np.float32)
    for top in range(0, camera.height, _ROWS_AT_ONCE):
        rows = np.arange(top, min(top + _ROWS_AT_ONCE, camera.height))
        columns, lines = np.meshgrid(np.arange(camera.width), rows)
        steady = np.column_stack([columns.ravel(), lines.ravel()]).astype(np.float64)
        shown = steady
        # The place of a pixel depends on the row in which it was exposed.
        for _ in range(_ITERATIONS):
            later_s = (shown / [camera.width - 1, camera.height - 1] - 0.5) @ np.array(readout_s)
            shown = shown + (steady - turned_pixels(camera, shown, later_s[:, None] * angular_velocity))
        source[rows] = shown.reshape(len(rows), camera.width, 2)
    straight = cv2.remap(picture, source, np.empty(0), cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(straight, np.uint8)
