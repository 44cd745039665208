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


def angular_speed(camera: CameraModel, images: Iterable[tuple[float, NDArray[np.uint8]]]) -> AngularSpeed:
    """How a camera turned, of its media times [s] and grey images (H, W), of which one is kept.

    An image that is not later than the one before is left out.

    Raises:
        RecordingError: an image has another size than the camera model.
    """
    scale = min(1.0, _IMAGE_WIDTH / camera.width)
    points = _Points(camera, scale)
    previous, previous_s = np.zeros((0, 0), np.uint8), -np.inf
    # Hours of video: eight bytes a number, not a hundred.
    times, omegas = array("d"), array("d")
    for media_s, image in images:
        if image.shape != (camera.height, camera.width):
            raise RecordingError(
                f"image of {image.shape[1]}x{image.shape[0]} pixels, but its lens is for "
                f"{camera.width}x{camera.height}; give the lens of the resolution that was recorded",
                camera.name,
            )
        if media_s <= previous_s:
            continue
        current = np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        if previous.size:
            times.append(0.5 * (media_s + previous_s))
            omegas.extend(points.turned(previous, current, seed=len(times)) / (media_s - previous_s))
        points.refresh(current)
        previous, previous_s = current, media_s
    return AngularSpeed(camera.name, np.array(times), np.array(omegas).reshape(-1, 3))


class _Points:
    """Points that are followed through images (H, W) at a scale of a camera's."""

    def __init__(self, camera: CameraModel, scale: float) -> None:
        self._camera, self._scale = camera, scale
        self._pixels, self._bearings = np.zeros((0, 2), np.float32), np.zeros((0, 3))
        self._age, self._turn = 0, np.eye(3)

    def turned(self, previous: NDArray[np.uint8], current: NDArray[np.uint8], seed: int) -> Array:
        """Rotation vector (3,) of the camera between two images [rad], NaN where unknown; moves the points on."""
        predicted, valid = self._camera.project(self._bearings @ self._turn.T)
        usable = valid & self._camera.in_image(predicted)
        # Pixel centres are integers in the small image and in the large one.
        start = np.where(usable[:, None], (predicted + 0.5) * self._scale - 0.5, self._pixels).astype(np.float32)
        before = self._bearings
        alive = self._keep(*follow(previous, current, self._pixels, start))
        self._turn, agree = estimate_rotation(before[alive], self._bearings, seed)
        return -log_so3(self._turn) if agree.any() else np.full(3, np.nan)

    def refresh(self, image: NDArray[np.uint8]) -> None:
        """Detect points anew where they are old, or half are lost."""
        self._age += 1
        if self._age >= _REFRESH_INTERVAL or len(self._pixels) < _CORNERS // 2:
            self._age, corners = 0, cv2.goodFeaturesToTrack(image, _CORNERS, 0.01, 7.0)
            pixels = np.zeros((0, 2), np.float32) if corners is None else corners.reshape(-1, 2)
            self._keep(pixels, np.ones(len(pixels), bool))

    def _keep(self, pixels: NDArray[np.float32], alive: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Go on with the living pixels (N, 2) that have a bearing; which those are."""
        bearings, in_view = self._camera.unproject((pixels.astype(np.float64) + 0.5) / self._scale - 0.5)
        alive = alive & in_view
        self._pixels, self._bearings = pixels[alive], bearings[alive]
        return alive
