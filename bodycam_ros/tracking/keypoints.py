"""SIFT keypoints and RootSIFT descriptors, the names by which tracks find their landmarks (A 4.1)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

DESCRIPTOR_LENGTH = 128
ROOT_SIFT_SCALE = 512.0
"""A unit vector of 128 positive entries seldom has one above 0.5: 512 fills a byte."""

_DOUBLING_OFFSET_PX = 0.25
"""OpenCV's SIFT doubles the image but halves the positions without the resampling's half pixel: too far by this."""


@dataclass(frozen=True)
class Keypoints:
    """SIFT keypoints of one image: pixels (N, 2) float32, scales (N,) float32 sigma [px], responses (N,)."""

    pixels: NDArray[np.float32]
    scales: NDArray[np.float32]
    responses: NDArray[np.float32]
    raw: tuple[cv2.KeyPoint, ...]


def root_sift(descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Turn (N, 128) SIFT into RootSIFT bytes (Arandjelovic and Zisserman 2012): Euclidean distance becomes Hellinger."""
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    return np.asarray(np.clip(np.rint(ROOT_SIFT_SCALE * np.sqrt(descriptors / total)), 0, 255), np.uint8)


class KeypointDetector:
    """Detects SIFT keypoints and describes the chosen ones."""

    def __init__(self, contrast_threshold: float) -> None:
        self._sift = cv2.SIFT_create(contrastThreshold=contrast_threshold)

    def detect(self, image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> Keypoints:
        """Find the keypoints of an (H, W) grey image where the (H, W) mask is not zero."""
        raw = self._sift.detect(image, mask)
        return Keypoints(
            np.array([k.pt for k in raw], np.float32).reshape(-1, 2) - np.float32(_DOUBLING_OFFSET_PX),
            np.array([0.5 * k.size for k in raw], np.float32),
            np.array([k.response for k in raw], np.float32),
            tuple(raw),
        )

    def describe(self, image: NDArray[np.uint8], keypoints: Keypoints, rows: NDArray[np.intp]) -> NDArray[np.uint8]:
        """RootSIFT (M, 128) of the chosen rows of ``keypoints``."""
        if len(rows) == 0:
            return np.zeros((0, DESCRIPTOR_LENGTH), np.uint8)
        _, descriptors = self._sift.compute(image, [keypoints.raw[int(row)] for row in rows])
        return root_sift(np.asarray(descriptors, np.float32))
