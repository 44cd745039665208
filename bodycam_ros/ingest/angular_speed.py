"""Angular velocity of a camera from its images alone (A eq. 2)."""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import log_so3
from bodycam_ros.tracking.optical_flow import follow
from bodycam_ros.tracking.rotation import estimate_rotation

Array = NDArray[np.float64]


_IMAGE_WIDTH = 320  # [px] images are reduced to: half a degree a pixel over a hundred bearings leaves hundredths
_CORNERS = 160  # followed; with half of them on the wearer and near things the rest keep a rotation to 0.1 deg
_REFRESH_INTERVAL = 6  # [frames] after which corners are detected anew, or when half are lost


@dataclass(frozen=True, eq=False)
class AngularSpeed:
    """How a camera turned.

    Attributes:
        camera: its name.
        media_s: (N,) media times half-way between two images [s], ascending.
        omega: (N, 3) angular velocity between them [rad/s] in the camera's axes; NaN where unknown.
    """

    camera: str
    media_s: Array
    omega: Array

    @property
    def speed(self) -> Array:
        """(N,) angular speed [rad/s], the same for all cameras of a rigid body."""
        speed: Array = np.linalg.norm(self.omega, axis=1)
        return speed

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) where it is known."""
        return np.asarray(np.isfinite(self.omega).all(axis=1))

    def part(self, chosen: NDArray[np.bool_]) -> "AngularSpeed":
        """What was measured at chosen (N,) times."""
        return AngularSpeed(self.camera, self.media_s[chosen], self.omega[chosen])


class AngularSpeedMeter:
    """Measures how a camera turns, image by image; keeps one image.

    Args:
        camera: its model, for bearings.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._scale = min(1.0, _IMAGE_WIDTH / camera.width)
        self._image: NDArray[np.uint8] | None = None
        self._media_s = 0.0
        self._pixels = np.zeros((0, 2), np.float32)
        self._bearings = np.zeros((0, 3))
        self._frames_since_refresh = 0
        self._turn = np.eye(3)
        # Hours of video: eight bytes a number, not a hundred.
        self._times = array("d")
        self._omegas = array("d")

    def add(self, media_s: float, image: NDArray[np.uint8]) -> None:
        """Take the next image.

        Args:
            media_s: its media time [s]; an image that is not later than the one before is left out.
            image: (H, W) grey image of the camera's size.

        Raises:
            RecordingError: the image has another size than the camera model.
        """
        expected = (self._camera.height, self._camera.width)
        if image.shape != expected:
            raise RecordingError(
                f"camera {self._camera.name}: image of {image.shape[1]}x{image.shape[0]} pixels, but its lens is for "
                f"{expected[1]}x{expected[0]}; give the lens of the resolution that was recorded"
            )
        if self._image is not None and media_s <= self._media_s:
            return
        small = self._small(image)
        if self._image is not None:
            seconds = media_s - self._media_s
            self._times.append(0.5 * (media_s + self._media_s))
            self._omegas.extend(self._turned(self._image, small) / seconds)
        self._image, self._media_s = small, media_s
        self._frames_since_refresh += 1
        if self._frames_since_refresh >= _REFRESH_INTERVAL or (len(self._pixels) < _CORNERS // 2):
            self._refresh(small)

    def angular_speed(self) -> AngularSpeed:
        """What was measured so far."""
        return AngularSpeed(self._camera.name, np.array(self._times), np.array(self._omegas).reshape(-1, 3))

    def _turned(self, previous: NDArray[np.uint8], current: NDArray[np.uint8]) -> Array:
        """Rotation vector (3,) of the camera between two images [rad], NaN where unknown; moves the points on."""
        bearings_previous = self._bearings
        predicted, valid = self._camera.project(bearings_previous @ self._turn.T)
        usable = valid & self._camera.in_image(predicted)
        start = np.where(usable[:, None], self._to_small(predicted), self._pixels).astype(np.float32)
        pixels, alive = follow(previous, current, self._pixels, start)
        bearings_current, in_view = self._camera.unproject(self._to_full(pixels))
        alive &= in_view
        self._pixels, self._bearings = pixels[alive], bearings_current[alive]
        current_R_previous, agree = estimate_rotation(bearings_previous[alive], self._bearings, seed=len(self._times))
        self._turn = current_R_previous
        if not agree.any():
            return np.full(3, np.nan)
        turned: Array = -log_so3(current_R_previous)
        return turned

    def _refresh(self, image: NDArray[np.uint8]) -> None:
        corners = cv2.goodFeaturesToTrack(image, _CORNERS, 0.01, 7.0, useHarrisDetector=False)
        self._frames_since_refresh = 0
        if corners is None:
            self._pixels, self._bearings = np.zeros((0, 2), np.float32), np.zeros((0, 3))
            return
        pixels = corners.reshape(-1, 2)
        bearings, in_view = self._camera.unproject(self._to_full(pixels))
        self._pixels, self._bearings = pixels[in_view], bearings[in_view]

    def _small(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self._scale == 1.0:
            return image
        size = (round(self._scale * self._camera.width), round(self._scale * self._camera.height))
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _to_small(self, pixels: NDArray[np.floating]) -> Array:
        # Pixel centres are integers in the small image and in the large one.
        small: Array = (np.asarray(pixels, np.float64) + 0.5) * self._scale - 0.5
        return small

    def _to_full(self, pixels: NDArray[np.floating]) -> Array:
        full: Array = (np.asarray(pixels, np.float64) + 0.5) / self._scale - 0.5
        return full


def angular_speed(camera: CameraModel, images: Iterable[tuple[float, NDArray[np.uint8]]]) -> AngularSpeed:
    """How a camera turned, of its media times [s] and grey images (H, W), which are taken one by one.

    Raises:
        RecordingError: an image has another size than the camera model.
    """
    meter = AngularSpeedMeter(camera)
    for media_s, image in images:
        meter.add(media_s, image)
    return meter.angular_speed()
