"""How sharp the frames of a moving camera are, and how far it has turned and gone from one to the next.

The rows of a camera that lay on its side are columns of the upright picture.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.geometry import exp_so3, log_so3
from bodycam_ros.tracking.rotation import RotationSettings, estimate_rotation


class Frame(Protocol):
    """One picture of the camera; its pixels are made only for who asks."""

    @property
    def seconds(self) -> float:
        """When it was taken, by the camera's own clock [s]."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W).

        Raises:
            RecordingError: it cannot be decoded.
        """

    def file(self) -> tuple[str, bytes]:
        """Suffix (".jpg", ".png") and content of an image file with it; raises as ``grey`` does."""


class MovingCamera(Protocol):
    """Frames that can be gone through more than once, the same each time.

    Attributes:
        name: of the video or topic, for people.
        camera: its lens.
        count: about how many frames there are.
        readout_s: by how much later the right border is exposed than the left, and the lower than the upper [s]; zero
            if all rows are exposed together, or nobody knows.
    """

    name: str
    camera: CameraModel
    count: int
    readout_s: tuple[float, float]

    def frames(self) -> AbstractContextManager[Iterator[Frame]]:
        """The frames in order of time, from the first on."""


Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_SHARP_WIDTH, _FLOW_WIDTH = 1280, 480
"""Blur by two pixels of what a map is made of must show; motion shows in far fewer pixels."""

_MOST_POINTS, _LEAST_POINTS = 200, 12
_LEAST_SHARE = 0.25  # of the points of the frame before; of a picture of something else fewer seem to be found again
_APART = 0.02  # of the width, between points that are followed
_ROTATION = RotationSettings()
_RETURN_PX = 1.0
_TREMOR_DEG = 2.0
"""What a hand that stays where it is moves the picture by. Points are followed until they moved by more, so that an
hour of it adds up to nothing."""


@dataclass(frozen=True)
class FrameMotion:
    """What is known of N frames.

    Attributes:
        seconds: (N,) when they were taken [s].
        sharpness: (N,) contrast of fine detail in the direction in which the frame has the least of it; comparable
            between frames that show the same.
        path_deg: (N,) by how much the view has changed since the first frame [deg]: the sum of what the directions to
            things changed by, be it because the camera turned or because it went past them. Never decreases.
        angular_velocity: (N, 3) by which the camera turned, in its own axes [rad/s]; zero where nobody needs it.
    """

    seconds: Array
    sharpness: Array
    path_deg: Array
    angular_velocity: Array


def frame_motion(source: MovingCamera, cut_deg: float, on_frame: Callable[[], None]) -> FrameMotion:
    """Go through all frames once. What cannot be decoded has no sharpness.

    Args:
        source: the frames.
        cut_deg: by how much a view is said to have changed where nothing of the frame before is seen any more.
        on_frame: called after each frame.

    Raises:
        MapError: there is no frame.
        LensError: the camera's intrinsics are for images of another size.
    """
    seconds, sharpness, path_deg, turns = [], [], [], []
    follower = _Follower(source.camera, cut_deg, turns=any(source.readout_s))
    with source.frames() as frames:
        for frame in frames:
            try:
                grey = frame.grey()
            except RecordingError:
                grey = None
            seconds.append(frame.seconds)
            if grey is None:
                sharpness.append(0.0)
                path_deg.append(follower.path_deg)
            else:
                _check_size(source, grey)
                sharpness.append(_sharpness(_at_width(grey, _SHARP_WIDTH)))
                path_deg.append(follower.follow(_at_width(grey, _FLOW_WIDTH)))
                turns.append((len(seconds) - 1, follower.turn))
            on_frame()
    if not any(sharpness):
        raise MapError(f"{source.name}: none of its {len(sharpness)} frames shows anything; give another recording")
    times, velocity = np.array(seconds), np.zeros((len(seconds), 3))
    decoded = [row for row, _ in turns]
    velocity[decoded] = _velocity(times[decoded], np.array([turn for _, turn in turns]))
    return FrameMotion(times, np.array(sharpness), np.maximum.accumulate(path_deg), velocity)


def _velocity(seconds: Array, turns: Array) -> Array:
    """(N, 3) angular velocity at each frame, the mean of both sides, of the turns (N, 3) [rad] from those before."""
    steps = np.diff(seconds, prepend=seconds[0] - 1.0, append=seconds[-1] + 1.0)
    rates = np.concatenate([turns, turns[-1:]]) / np.maximum(steps, 1e-6)[:, None]
    rates[0], rates[-1] = rates[1], rates[-2]
    return np.asarray(0.5 * (rates[:-1] + rates[1:]), np.float64)


class _Follower:
    """Follows points from frame to frame, and sums up what the directions to them change by."""

    def __init__(self, camera: CameraModel, cut_deg: float, turns: bool) -> None:
        self._camera = camera
        self._cut_deg = cut_deg
        self._before_deg = 0.0
        self._grey: Grey | None = None
        self._pixels = np.zeros((0, 1, 2), np.float32)
        self._first_rays = np.zeros((0, 3))
        self._begun = 0
        self._turns = turns
        self.path_deg = 0.0
        self.turn = np.zeros(3)

    def follow(self, grey: Grey) -> float:
        """How far the view has changed until this frame [deg]; ``turn`` [rad] is by how much since the one before."""
        self.turn = np.zeros(3)
        if self._grey is not None and len(self._pixels) >= _LEAST_POINTS:
            ahead, kept = _followed(self._grey, grey, self._pixels)
            before = self._pixels[kept]
            self._pixels, self._first_rays = ahead[kept], self._first_rays[kept]
            # Some points always seem to be found again, in whatever picture.
            if kept.sum() < max(_LEAST_POINTS, _LEAST_SHARE * len(kept)):
                self.path_deg += self._cut_deg
                self._pixels = self._pixels[:0]
            else:
                if self._turns:
                    self._measure_turn(before, grey)
                self._measure(grey)
        if len(self._pixels) < max(_LEAST_POINTS, self._begun // 2):
            self._begin(grey)
        self._grey = grey
        return self.path_deg

    def _measure_turn(self, before: NDArray[np.float32], grey: Grey) -> None:
        """The turn since the frame in which the points were at pixels (N, 1, 2), by most of them (A eq. 2)."""
        then, now = self._rays(before, grey), self._rays(self._pixels, grey)
        known = np.isfinite(then[:, 0]) & np.isfinite(now[:, 0])
        current_R_previous, _ = estimate_rotation(then[known], now[known], _ROTATION, seed=0)
        self.turn = log_so3(current_R_previous.T)

    def _measure(self, grey: Grey) -> None:
        cosines = np.einsum("ij,ij->i", self._rays(self._pixels, grey), self._first_rays)
        moved_deg = float(np.degrees(np.arccos(np.clip(np.nanmedian(cosines), -1.0, 1.0))))
        self.path_deg = self._before_deg + moved_deg
        if moved_deg > _TREMOR_DEG:
            self._pixels = self._pixels[:0]

    def _begin(self, grey: Grey) -> None:
        self._before_deg = self.path_deg
        found = cv2.goodFeaturesToTrack(grey, _MOST_POINTS, 0.01, _APART * grey.shape[1])
        self._pixels = np.zeros((0, 1, 2), np.float32) if found is None else np.asarray(found, np.float32)
        self._first_rays = self._rays(self._pixels, grey)
        self._begun = len(self._pixels)

    def _rays(self, pixels: NDArray[np.float32], grey: Grey) -> Array:
        """Unit bearings (N, 3) of pixels (N, 1, 2) in the smaller picture; NaN outside the lens."""
        scale = self._camera.width / grey.shape[1]
        return self._camera.unproject(scale * (pixels[:, 0] + 0.5) - 0.5)[0]


def _followed(before: Grey, after: Grey, pixels: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where points (N, 1, 2) have gone, and which of them come back to where they were when they are followed back."""
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
    """Root of the smaller eigenvalue of the mean structure tensor: blur by motion takes detail in one direction."""
    across, down = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1), cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1)
    xx, yy, xy = (float(np.mean(product)) for product in (across * across, down * down, across * down))
    smaller = 0.5 * (xx + yy - np.hypot(xx - yy, 2.0 * xy))
    return float(np.sqrt(max(0.0, smaller)))


def _check_size(source: MovingCamera, grey: Grey) -> None:
    camera = source.camera
    if grey.shape != (camera.height, camera.width):
        raise LensError(
            f"{source.name}: its images have {grey.shape[1]} x {grey.shape[0]} pixels, but its intrinsics are for "
            f"{camera.width} x {camera.height}; give the calibration of this mode with --camera"
        )


_ROWS_AT_ONCE = 200  # bounds the memory that a large picture takes
_REFINEMENTS = 2


def steady_picture(
    picture: NDArray[np.uint8], camera: CameraModel, angular_velocity: Array, readout_s: tuple[float, float]
) -> NDArray[np.uint8]:
    """Undo what the camera's turning did to a picture while it was read out.

    What it did by moving on is left: of things that are metres away it is a tenth of that.

    Args:
        picture: (H, W) or (H, W, 3) pixels.
        camera: its lens.
        angular_velocity: (3,) in camera axes [rad/s].
        readout_s: by how much later the right border was exposed than the left, and the lower than the upper [s].
    """
    source = np.empty((camera.height, camera.width, 2), np.float32)
    for top in range(0, camera.height, _ROWS_AT_ONCE):
        rows = np.arange(top, min(top + _ROWS_AT_ONCE, camera.height))
        columns, lines = np.meshgrid(np.arange(camera.width), rows)
        steady = np.column_stack([columns.ravel(), lines.ravel()]).astype(np.float64)
        shown = steady
        # Where a pixel was shown depends on the row that it was shown in.
        for _ in range(_REFINEMENTS):
            shown = shown + (steady - _steady_pixels(camera, shown, angular_velocity, readout_s))
        source[rows] = shown.reshape(len(rows), camera.width, 2)
    straight = cv2.remap(picture, source, np.empty(0), cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(straight, np.uint8)


def _steady_pixels(
    camera: CameraModel, pixels: Array, angular_velocity: Array, readout_s: tuple[float, float]
) -> Array:
    """Where pixels (M, 2) would be if all were exposed with the middle of the picture."""
    bearings, in_view = camera.unproject(pixels)
    later_s = (pixels / [camera.width - 1, camera.height - 1] - 0.5) @ np.array(readout_s)
    turns = exp_so3(later_s[:, None] * angular_velocity)
    steady, valid = camera.project((turns @ bearings[:, :, None])[:, :, 0])
    return np.where((in_view & valid)[:, None], steady, pixels)
