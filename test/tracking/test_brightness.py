"""Flow between images whose light changed, against the shift that made them."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.tracking.optical_flow import follow

SHIFT = np.array([2.3, -1.4], np.float32)


@pytest.fixture(scope="module")
def image() -> NDArray[np.uint8]:
    """Grey texture around 90, with coarse and fine parts."""
    noise = np.random.default_rng(2).normal(size=(240, 320)).astype(np.float32)
    texture = sum(cv2.GaussianBlur(noise, (0, 0), s) * s for s in (1.5, 4.0, 10.0))
    return np.clip(90 + 25 * texture / texture.std(), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def points(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    corners = cv2.goodFeaturesToTrack(image[30:-30, 30:-30], 100, 0.01, 7).reshape(-1, 2)
    return corners.astype(np.float32) + 30


def moved(image: NDArray[np.uint8], gain: float) -> NDArray[np.uint8]:
    """The image moved by SHIFT, as brighter or darker as the gain says."""
    matrix = np.array([[1, 0, SHIFT[0]], [0, 1, SHIFT[1]]], np.float32)
    warped = cv2.warpAffine(image, matrix, (image.shape[1], image.shape[0]), flags=cv2.INTER_CUBIC)
    return np.clip(gain * warped.astype(float), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("gain", [1.0, 0.97, 1.04, 0.9, 0.8, 1.25])
def test_light_that_changes_is_not_taken_for_motion(
    image: NDArray[np.uint8], points: NDArray[np.float32], gain: float
) -> None:
    found, alive = follow(image, moved(image, gain), points, points)
    assert alive.mean() > 0.9
    errors = np.linalg.norm(found - points - SHIFT, axis=1)[alive]
    assert np.median(errors) < 0.12
    assert np.percentile(errors, 90) < 0.25
