"""How sharp the frames of a moving camera are, and how far it has turned and gone from one to the next."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError, MapError, RecordingError
from bodycam_ros.mapping.moving_camera import MovingCamera

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_SHARP_WIDTH, _FLOW_WIDTH = 1280, 480
"""Blur by two pixels of what a map is made of must show; motion shows in far fewer pixels."""

_MOST_POINTS, _LEAST_POINTS = 200, 12
_APART = 0.02  # of the width, between points that are followed
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
    """

    seconds: Array
    sharpness: Array
    path_deg: Array


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
    seconds, sharpness, path_deg = [], [], []
    follower = _Follower(source.camera, cut_deg)
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
            on_frame()
    if not any(sharpness):
        raise MapError(f"{source.name}: none of its {len(sharpness)} frames shows anything; give another recording")
    return FrameMotion(np.array(seconds), np.array(sharpness), np.maximum.accumulate(path_deg))


class _Follower:
    """Follows points from frame to frame, and sums up what the directions to them change by."""

    def __init__(self, camera: CameraModel, cut_deg: float) -> None:
        self._camera = camera
        self._cut_deg = cut_deg
        self._before_deg = 0.0
        self._grey: Grey | None = None
        self._pixels = np.zeros((0, 1, 2), np.float32)
        self._first_rays = np.zeros((0, 3))
        self._begun = 0
        self.path_deg = 0.0

    def follow(self, grey: Grey) -> float:
        """How far the view has changed until this frame [deg]."""
        if self._grey is not None and len(self._pixels):
            ahead, found, _ = cv2.calcOpticalFlowPyrLK(self._grey, grey, self._pixels, np.empty_like(self._pixels))
            height, width = grey.shape
            inside = np.all((ahead[:, 0] >= 0.0) & (ahead[:, 0] <= (width - 1, height - 1)), axis=1)
            kept = (found.ravel() == 1) & inside
            self._pixels, self._first_rays = ahead[kept], self._first_rays[kept]
            self._measure(grey)
        if self._grey is None or len(self._pixels) < max(_LEAST_POINTS, self._begun // 2):
            self._begin(grey)
        self._grey = grey
        return self.path_deg

    def _measure(self, grey: Grey) -> None:
        if len(self._pixels) < _LEAST_POINTS:
            if self._begun >= _LEAST_POINTS:
                self.path_deg += self._cut_deg
            return
        rays = self._rays(self._pixels, grey)
        cosines = np.einsum("ij,ij->i", rays, self._first_rays)
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
