"""Test of a camera's calibration against its own images: the epipolar error of tracked points.

Two images of a camera that turned and moved are related by a rotation and a direction of translation if the rays of
their points are right. With the calibration of another lens mode (linear instead of wide, a crop by stabilisation) the
epipolar error is larger than with rays that lie closer together or farther apart.
"""

import logging
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array, exp_so3, log_so3
from bodycam_ros.lens.lens_fit import lens_numbers, with_lens
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.tracking.optical_flow import follow
from bodycam_ros.tracking.rotation import estimate_rotation

if TYPE_CHECKING:
    from bodycam_ros.mapping.moving_camera import MovingCamera

logger = logging.getLogger(__name__)

Grey = NDArray[np.uint8]

PointPair = tuple[Array, Array]
"""Pixels (N, 2) of the same points in two images of a camera."""

_SCALES = np.geomspace(0.5, 2.0, 25)  # of the focal lengths; the thirteenth is 1
_GIVEN = len(_SCALES) // 2

_WIDTH = 640  # [px] images are reduced to it for tracking
_POINTS, _MIN_POINTS = 300, 60  # detected at first; tracked to the end of a pair
_MIN_SHIFT = 0.12  # median motion of the points from image to image of a pair, of the width
_MAX_IMAGES = 30  # from the first image of a pair to the second
_PAIRS = 8  # compared per camera; 70 ms each

_MIN_PAIRS = 4
_MIN_RAYS, _MIN_SHARE = 30, 0.8  # points of a pair with a ray, and their share
_MIN_TURN_DEG = 4.0  # between two images; translation alone does not constrain the focal length
_MISMATCH = 1.06  # scale of the focal length, or its inverse; lens modes differ by more
_CLEAR_SHARE = 0.75  # largest error with the best scale, as a share of the error with the given lens
_LEAST_GAIN_PX = 0.1  # decrease of the error; less is the tracker's, and a plane that shifts tells no focal length
_CLEAR_PAIRS = 0.75  # smallest share of the pairs whose error decreases
_INLIER_ANGLE_DEG, _HYPOTHESES = 2.0, 64
_SPREADS_PX = np.geomspace(10.0, 0.7, 16)  # Geman-McClure scale per iteration; points on the wearer are outliers
_TINY = 1e-12

_BAG_IMAGES, _VIDEO_FRAMES = 300, 900  # examined per camera

_MODES = (
    (0.65, "so it shows much more, as in the mode 'wide' where the lens was measured in 'narrow' or with zoom"),
    (0.82, "so it shows more, as in the mode 'wide' where the lens was measured in 'linear'"),
    (1.0, "so it shows more, as with stabilisation off where the lens was measured with it on"),
    (1.22, "so it shows less, as with stabilisation on (a crop by a tenth)"),
    (1.55, "so it shows less, as in the mode 'linear' in place of 'wide', or with strong stabilisation"),
    (np.inf, "so it shows much less, as in the mode 'narrow' or with digital zoom"),
)
"""Likely lens mode of scales up to a limit."""


@dataclass(frozen=True)
class LensMatch:
    """Result of the comparison of a calibration with images.

    Attributes:
        camera: its name.
        scale: factor by which the focal lengths should be larger; 1 where nothing contradicts the calibration.
        error_px: median epipolar error with the calibration as given [px].
        best_px: the same at ``scale`` [px].
        pairs: image pairs that were compared; fewer than four give no result.
    """

    camera: str
    scale: float
    error_px: float
    best_px: float
    pairs: int

    @property
    def matches(self) -> bool:
        """Whether nothing contradicts the calibration."""
        return self.scale == 1.0

    @property
    def text(self) -> str:
        """What contradicts the lens, and what to do: a line that names the camera."""
        return f"camera {self.camera}: {self.cause}"

    @property
    def cause(self) -> str:
        """The line without the camera."""
        mode = next(mode for limit, mode in _MODES if self.scale <= limit)
        return (
            f"images do not fit its calibration (camera_info): points are "
            f"{self.error_px:.1f} px off their epipolar lines, {self.best_px:.1f} px if focal lengths were "
            f"{self.scale:.2f} times as long, {mode}. Measure the lens in the mode that was recorded in "
            "(bodycam lens), or record in the lens' mode"
        )


def match_lens(camera: CameraModel, pairs: Iterable[PointPair]) -> LensMatch:
    """Compare a calibration with points of image pairs that were taken some tenths of a second apart."""
    errors_pairs = [errors for pair in pairs if (errors := _errors_px(camera, pair)) is not None]
    if len(errors_pairs) < _MIN_PAIRS:
        return LensMatch(camera.name, 1.0, 0.0, 0.0, len(errors_pairs))
    median = np.median(errors_pairs, axis=0)
    if not np.isfinite(median[_GIVEN]):
        return LensMatch(camera.name, 1.0, 0.0, 0.0, 0)
    errors, best = np.array(errors_pairs), int(np.argmin(median))
    decreased = np.mean(errors[:, best] < errors[:, _GIVEN])
    gain_px = median[_GIVEN] - median[best]
    is_clear = gain_px > max(_LEAST_GAIN_PX, (1.0 - _CLEAR_SHARE) * median[_GIVEN]) and decreased >= _CLEAR_PAIRS
    if not is_clear or 1.0 / _MISMATCH < _SCALES[best] < _MISMATCH:
        best = _GIVEN
    scale = 1.0 if best == _GIVEN else float(_SCALES[best])
    return LensMatch(camera.name, scale, float(median[_GIVEN]), float(median[best]), len(errors))


def match_images(camera: CameraModel, images: Iterable[Grey], most_images: int = _BAG_IMAGES) -> LensMatch:
    """Compare a calibration with successive images, grey (H, W), until there are enough pairs."""
    return match_lens(camera, islice(_point_pairs(islice(images, most_images)), _PAIRS))


def find_mismatches(path: Path, cameras: Collection[str], names: TopicNames = AS_RECORDED) -> Iterator[LensMatch]:
    """Check some cameras of a bag, some seconds each, and yield those whose images do not fit their calibration.

    Raises:
        RecordingError: not a bag.
    """
    from bodycam_ros.recording.bag_reader import open_recording

    with open_recording(path, names) as recording:
        for camera in cameras:
            if camera in recording.cameras:
                model = recording.camera_model(camera)
                match = match_images(model, _decoded(recording.images([camera]), model))
                if not match.matches:
                    yield match


def warn_of_mismatch(source: "MovingCamera") -> None:
    """Log a warning if the frames of a video do not fit its calibration: mapping would fail."""
    with source.frames() as frames:
        match = match_images(source.camera, _decoded(frames, source.camera), _VIDEO_FRAMES)
    if not match.matches:
        logger.warning("%s: %s", source.name, match.text)


def _point_pairs(images: Iterable[Grey]) -> Iterator[PointPair]:
    """Common points of pairs of images (H, W), tracked from image to image until they have moved far enough."""
    previous: Grey | None = None
    first = points = np.zeros((0, 2), np.float32)
    age = 0
    for image in images:
        scale = min(1.0, _WIDTH / image.shape[1])
        small = np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        if previous is not None and len(points):
            followed, kept = follow(previous, small, points, points)
            first = first[kept]
            points = followed[kept]
            age = age + 1
            shifts = np.linalg.norm(points - first, axis=1)
            if len(shifts) >= _MIN_POINTS and np.median(shifts) >= _MIN_SHIFT * small.shape[1]:
                yield _full_size(first, scale), _full_size(points, scale)
                points = points[:0]
        if len(points) < _MIN_POINTS or age >= _MAX_IMAGES:
            corners = cv2.goodFeaturesToTrack(small, _POINTS, 0.01, 7.0)
            first = points = np.zeros((0, 2), np.float32) if corners is None else corners.reshape(-1, 2)
            age = 0
        previous = small


def _full_size(pixels: NDArray[np.float32], scale: float) -> Array:
    """Pixels of the image before its reduction; centres are integers in both."""
    full: Array = (pixels.astype(np.float64) + 0.5) / scale - 0.5
    return full


def _decoded(images: Iterable[CameraImage], model: CameraModel) -> Iterator[Grey]:
    """Images of the calibration's size; the tracker reports others."""
    for image in images:
        with suppress(RecordingError):
            grey = decode_grey(image)
            if grey.shape == (model.height, model.width):
                yield grey


def _errors_px(camera: CameraModel, pair: PointPair) -> Array | None:
    """(scales,) median epipolar errors [px] of a pair; None if the camera turned too little for them to differ."""
    fitted = _rotation(*_rays(camera, pair))
    if fitted is None or np.degrees(np.linalg.norm(log_so3(fitted))) < _MIN_TURN_DEG:
        return None
    lens = lens_numbers(camera)
    return np.array([_epipolar_error(with_lens(camera, np.r_[s * lens[:2], lens[2:]]), pair) for s in _SCALES])


def _rays(camera: CameraModel, pair: PointPair) -> tuple[Array, Array]:
    (first, first_valid), (second, second_valid) = (camera.unproject(pixels) for pixels in pair)
    both = first_valid & second_valid
    return first[both], second[both]


def _rotation(first: Array, second: Array) -> Array | None:
    """second_R_first (3, 3) that most rays agree on, or None."""
    if len(first) < _MIN_RAYS:
        return None
    R, agree = estimate_rotation(first, second, 0, _INLIER_ANGLE_DEG, _HYPOTHESES)
    return R if agree.any() else None


def _epipolar_error(camera: CameraModel, pair: PointPair) -> float:
    """Median distance of points from their epipolar lines [px] at the best rotation and direction; infinite if none."""
    first, second = _rays(camera, pair)
    R = _rotation(first, second)
    if R is None or len(first) < _MIN_SHARE * len(pair[0]):
        return np.inf
    focal = 0.5 * (camera.fx + camera.fy)
    weights = np.ones(len(first))
    for spread in _SPREADS_PX:
        turned = first @ R.T
        normals = np.cross(turned, second)
        direction = np.linalg.eigh((normals * weights[:, None]).T @ normals)[1][:, 0]
        along = turned @ direction
        reach = np.sqrt(np.maximum(1.0 - along**2, _TINY))
        errors = normals @ direction / reach * focal
        weights = 1.0 / (1.0 + (errors / spread) ** 2) ** 2
        by_rotation = along[:, None] * second - np.sum(turned * second, axis=1, keepdims=True) * direction
        J = by_rotation / reach[:, None] * focal
        H = (J * weights[:, None]).T @ J
        H += 1e-6 * np.trace(H) * np.eye(3)
        R = exp_so3(-np.linalg.solve(H, (J * weights[:, None]).T @ errors)) @ R
    return float(np.median(np.abs(errors)))
