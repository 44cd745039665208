"""Sharpness and motion of the frames of a moving camera, and pictures without the effect of their read-out."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.geometry import log_so3
from bodycam_ros.mapping.moving_camera import MovingCamera
from bodycam_ros.registration.pose_fit import turned_pixels
from bodycam_ros.tracking.rotation import estimate_rotation

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_SHARP_WIDTH = 1280  # [px] blur over two pixels of a photograph must show
_FLOW_WIDTH = 480  # [px]
_MAX_POINTS, _MIN_POINTS = 200, 12
_MIN_SHARE = 0.25  # of the points of the frame before; between unrelated pictures fewer seem to be found again
_SPACING = 0.02  # of the width, between points that are followed
_RETURN_PX = 1.0
_CUT_DEG = 12.0  # change of view where all points are lost
_TREMOR_DEG = 2.0  # of a steady hand: points are followed until they moved by more, so that tremor does not add up
_ROWS_AT_ONCE = 200  # bounds the memory that a large picture takes
_ITERATIONS = 2


@dataclass(frozen=True)
class FrameMotion:
    """Motion of N frames.

    Attributes:
        seconds: (N,) stamps [s].
        sharpness: (N,) contrast of fine detail in the direction in which the frame has the least of it; comparable
            between frames of the same scene; 0 of what cannot be decoded.
        path_deg: (N,) accumulated change of view [deg]: median change of the directions to points, by rotation or by
            passing them. Never decreases.
        angular_velocity: (N, 3) in camera axes [rad/s]; zero where all rows are exposed together.
    """

    seconds: Array
    sharpness: Array
    path_deg: Array
    angular_velocity: Array


def measure_motion(source: MovingCamera, on_frame: Callable[[], None]) -> FrameMotion:
    """Go through all frames once.

    Args:
        source: the frames.
        on_frame: called after each frame.

    Raises:
        MapError: there is no frame.
        LensError: the camera's intrinsics are for images of another size.
    """
    camera, has_readout = source.camera, any(source.readout_s)
    view = _ViewChange(camera)
    seconds, sharpness, path_deg, turns = [], [], [], []
    with source.frames() as frames:
        for frame in frames:
            seconds.append(frame.seconds)
            try:
                grey = frame.grey()
            except RecordingError:
                sharpness.append(0.0)
            else:
                if grey.shape != (camera.height, camera.width):
                    raise LensError(
                        f"{source.name}: its images have {grey.shape[1]} x {grey.shape[0]} pixels, but its intrinsics "
                        f"are for {camera.width} x {camera.height}; give the calibration of this mode with --camera"
                    )
                sharpness.append(_sharpness(_at_width(grey, _SHARP_WIDTH)))
                turn = view.add(_at_width(grey, _FLOW_WIDTH), has_readout)
                turns.append((len(seconds) - 1, turn))
            path_deg.append(view.path_deg)
            on_frame()
    if not any(sharpness):
        raise MapError(f"{source.name}: none of its {len(sharpness)} frames shows anything; give another recording")
    times, velocity = np.array(seconds), np.zeros((len(seconds), 3))
    decoded = [row for row, _ in turns]
    velocity[decoded] = _velocity(times[decoded], np.array([turn for _, turn in turns]))
    return FrameMotion(times, np.array(sharpness), np.maximum.accumulate(path_deg), velocity)


def _velocity(seconds: Array, turns: Array) -> Array:
    """(N, 3) angular velocity at each frame, the mean of both sides, of rotations (N, 3) [rad] from frame to frame."""
    steps = np.diff(seconds, prepend=seconds[0] - 1.0, append=seconds[-1] + 1.0)
    rates = np.concatenate([turns, turns[-1:]]) / np.maximum(steps, 1e-6)[:, None]
    rates[0], rates[-1] = rates[1], rates[-2]
    return np.asarray(0.5 * (rates[:-1] + rates[1:]), np.float64)


class _ViewChange:
    """Follows points from frame to frame, and accumulates the change of their directions: ``path_deg``."""

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._start_deg = self.path_deg = 0.0
        self._grey: Grey | None = None
        self._pixels = np.zeros((0, 1, 2), np.float32)
        self._first_rays = np.zeros((0, 3))
        self._started = 0

    def add(self, grey: Grey, with_rotation: bool) -> Array:
        """Add the next frame (H, W); its rotation (3,) since the one before [rad] if asked for, else zero."""
        turn = np.zeros(3)
        if self._grey is not None and len(self._pixels) >= _MIN_POINTS:
            ahead, kept = _follow(self._grey, grey, self._pixels)
            before = self._pixels[kept]
            self._pixels, self._first_rays = ahead[kept], self._first_rays[kept]
            # Some points always seem to be found again, in whatever picture.
            if kept.sum() < max(_MIN_POINTS, _MIN_SHARE * len(kept)):
                self.path_deg += _CUT_DEG
                self._pixels = self._pixels[:0]
            else:
                rays = self._rays(self._pixels, grey)
                if with_rotation:
                    turn = _rotation(self._rays(before, grey), rays)
                cosine = np.nanmedian(np.einsum("ij,ij->i", rays, self._first_rays))
                moved_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
                self.path_deg = self._start_deg + moved_deg
                if moved_deg > _TREMOR_DEG:
                    self._pixels = self._pixels[:0]
        if len(self._pixels) < max(_MIN_POINTS, self._started // 2):
            self._start_deg = self.path_deg
            found = cv2.goodFeaturesToTrack(grey, _MAX_POINTS, 0.01, _SPACING * grey.shape[1])
            self._pixels = np.zeros((0, 1, 2), np.float32) if found is None else np.asarray(found, np.float32)
            self._first_rays = self._rays(self._pixels, grey)
            self._started = len(self._pixels)
        self._grey = grey
        return turn

    def _rays(self, pixels: NDArray[np.float32], grey: Grey) -> Array:
        """Unit bearings (N, 3) of pixels (N, 1, 2) in the smaller picture; NaN outside the lens."""
        scale = self._camera.width / grey.shape[1]
        return self._camera.unproject(scale * (pixels[:, 0] + 0.5) - 0.5)[0]


def _rotation(before: Array, now: Array) -> Array:
    """Rotation vector (3,) [rad] of the camera between the bearings (N, 3) of two frames (A eq. 2)."""
    known = np.isfinite(before[:, 0]) & np.isfinite(now[:, 0])
    return log_so3(estimate_rotation(before[known], now[known], seed=0)[0].T)


def _follow(before: Grey, after: Grey, pixels: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where points (N, 1, 2) moved, and which of them return when they are followed back."""
    ahead, found, _ = cv2.calcOpticalFlowPyrLK(before, after, pixels, np.empty_like(pixels))
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(after, before, ahead, np.empty_like(pixels))
    height, width = after.shape
    inside = np.all((ahead[:, 0] >= 0.0) & (ahead[:, 0] <= (width - 1, height - 1)), axis=1)
    returned = np.linalg.norm(back[:, 0] - pixels[:, 0], axis=1) < _RETURN_PX
    kept: NDArray[np.bool_] = (found.ravel() == 1) & (found_back.ravel() == 1) & inside & returned
    return np.asarray(ahead, np.float32), kept


def _at_width(grey: Grey, width: int) -> Grey:
    """The picture at no more than a width [px]."""
    scale = width / grey.shape[1]
    if scale >= 1.0:
        return grey
    size = (width, max(1, round(scale * grey.shape[0])))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)


def _sharpness(grey: Grey) -> float:
    """Root of the smaller eigenvalue of the mean structure tensor: motion blur removes detail in one direction."""
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
