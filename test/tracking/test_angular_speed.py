"""How fast a camera turns, measured on rendered images of a sphere, and on recordings against the truth."""

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from helpers.naming import naming
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3
from bodycam_ros.tracking.angular_speed import angular_speed

OMEGA = np.array([0.6, -1.1, 0.8])  # [rad/s]
RATE = 30.0


@pytest.fixture(scope="module")
def camera() -> CameraModel:
    k = (240.0, 0.0, 319.5, 0.0, 240.0, 239.5, 0.0, 0.0, 1.0)
    return camera_from_info("head", 640, 480, "equidistant", (0.0, 0.0, 0.0, 0.0), k)


def images(camera: CameraModel, count: int) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """A textured sphere around a camera that turns steadily about an oblique axis of its own."""
    noise = np.random.default_rng(5).normal(size=(700, 1400))
    texture = sum(gaussian_filter(noise, s, mode="wrap") * s for s in (1.5, 4.0, 12.0))
    texture = np.clip(110.0 + 60.0 * texture / texture.std(), 0, 255).astype(np.float32)
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    bearings, _ = camera.unproject(np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64))
    for index in range(count):
        x, y, z = (np.nan_to_num(bearings) @ exp_so3(OMEGA * index / RATE).T).T
        u = (np.arctan2(x, z) / (2 * np.pi) + 0.5) * (texture.shape[1] - 1)
        v = (np.arcsin(np.clip(y, -1, 1)) / np.pi + 0.5) * (texture.shape[0] - 1)
        shape = (camera.height, camera.width)
        maps = u.reshape(shape).astype(np.float32), v.reshape(shape).astype(np.float32)
        yield 2.0 + index / RATE, np.asarray(cv2.remap(texture, *maps, cv2.INTER_LINEAR), np.uint8)


def test_a_steady_turn_is_measured(camera: CameraModel) -> None:
    measured = angular_speed(camera, images(camera, 12))
    assert measured.media_s == pytest.approx(2.0 + (np.arange(11) + 0.5) / RATE)
    assert np.abs(measured.omega - OMEGA).max() < 0.03
    assert measured.speed == pytest.approx(np.linalg.norm(OMEGA), abs=0.02)


def test_dark_images_are_unknown_and_what_follows_is_known_again(camera: CameraModel) -> None:
    def with_dark() -> Iterator[tuple[float, NDArray[np.uint8]]]:
        for index, (media_s, image) in enumerate(images(camera, 12)):
            yield media_s, np.zeros_like(image) if index in (4, 5) else image

    measured = angular_speed(camera, with_dark())
    assert list(np.flatnonzero(~measured.known)) == [3, 4, 5]
    assert np.abs(measured.omega[measured.known] - OMEGA).max() < 0.05


def test_an_image_of_another_size_is_refused(camera: CameraModel) -> None:
    with naming(RecordingError, "camera head", "320x240", "640x480"):
        angular_speed(camera, [(0.0, np.zeros((240, 320), np.uint8))])


def test_an_image_that_is_not_later_is_left_out(camera: CameraModel) -> None:
    twice = [item for item in images(camera, 4) for _ in range(2)]
    assert len(angular_speed(camera, twice).media_s) == 3
