"""SIFT keypoints and RootSIFT descriptors, by which tracks are matched to landmarks (A 4.1).

The strong ones of every part of the picture become tracks, none upon another.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.settings import setting
from bodycam_ros.tracking.near_pairs import near_pairs
from bodycam_ros.tracking.track_frame import DESCRIPTOR_LENGTH

_ROOT_SIFT_SCALE = 512.0  # a unit vector of 128 positive entries seldom has one above 0.5: 512 fills a byte
_DOUBLING_OFFSET_PX = 0.25  # OpenCV's SIFT doubles the image, but halves positions without the resampling's half pixel
_MAX_KEYPOINTS_LOST = 1000  # where people fill half of the picture, a tenth of the strongest are landmarks
_CELLS = 8  # columns and rows of the picture with equal shares: people in bright clothes would else have all keypoints


@dataclass(frozen=True)
class KeypointSettings:
    """Where and how densely keypoints are detected."""

    image_scale: float = setting(
        0.5,
        limits=(0.25, 1.0),
        reason="scale of the image in which keypoints are detected; at half size detection takes a quarter of the "
        "time, and the keypoints that it misses are seldom in the photographs",
    )
    contrast_threshold: float = setting(
        0.02,
        limits=(0.001, 0.2),
        reason="minimum SIFT contrast of a keypoint; lower it to find more in dim halls and compressed images, with "
        "more noise",
    )
    max_keypoints: int = setting(
        350,
        limits=(50, 20000),
        reason="most keypoints of an image, the strongest; about a quarter of them are landmarks of the map, and a "
        "hundred landmarks give a pose to millimetres",
    )


@dataclass(frozen=True)
class Keypoints:
    """SIFT keypoints of one image; the strongest of every cell come first.

    Attributes:
        pixels: (N, 2) float32.
        scales: (N,) float32 sigma [px].
        responses: (N,) float32 contrast.
        descriptors: (N, 128) uint8 RootSIFT.
    """

    pixels: NDArray[np.float32]
    scales: NDArray[np.float32]
    responses: NDArray[np.float32]
    descriptors: NDArray[np.uint8]


def root_sift(descriptors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """RootSIFT (N, 128) as bytes of SIFT descriptors (N, 128): Arandjelovic and Zisserman 2012, section 3."""
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    return np.asarray(np.clip(np.rint(_ROOT_SIFT_SCALE * np.sqrt(descriptors / total)), 0, 255), np.uint8)


class KeypointDetector:
    """Detects and describes the SIFT keypoints of an image.

    Args:
        settings: of the detector.
        cells: columns and rows of the picture that get equal shares of the keypoints; 1 takes the strongest anywhere.
    """

    def __init__(self, settings: KeypointSettings, cells: int = _CELLS) -> None:
        self._settings, self._cells = settings, cells
        self._sift = cv2.SIFT_create(
            nfeatures=settings.max_keypoints if cells == 1 else 0, contrastThreshold=settings.contrast_threshold
        )

    def detect(self, image: NDArray[np.uint8], mask: NDArray[np.uint8], lost: bool = False) -> Keypoints:
        """Keypoints of an (H, W) grey image where the (H, W) mask is not zero; more for a camera that is lost."""
        scale, most = self._settings.image_scale, self._settings.max_keypoints
        if scale < 1.0:
            size = [max(1, round(scale * side)) for side in image.shape[::-1]]
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
            mask = np.asarray(cv2.resize(mask, image.shape[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)
        raw, descriptors = self._detect(image, mask, max(most, _MAX_KEYPOINTS_LOST) if lost else most)
        if descriptors is None:
            nothing = np.zeros((0, 2), np.float32)
            return Keypoints(nothing, nothing[:, 0], nothing[:, 0], np.zeros((0, DESCRIPTOR_LENGTH), np.uint8))
        pixels = np.array([k.pt for k in raw], np.float32).reshape(-1, 2) - np.float32(_DOUBLING_OFFSET_PX)
        return Keypoints(
            # Pixel centres are integers in the small image and in the large one.
            ((pixels + 0.5) / scale - 0.5).astype(np.float32),
            np.array([0.5 * k.size / scale for k in raw], np.float32),
            np.array([k.response for k in raw], np.float32),
            root_sift(np.asarray(descriptors, np.float32)),
        )

    def _detect(
        self, image: NDArray[np.uint8], mask: NDArray[np.uint8], most: int
    ) -> tuple[Sequence[cv2.KeyPoint], NDArray[np.float32] | None]:
        """OpenCV's keypoints and descriptors; only what is kept is described."""
        if self._cells == 1:
            raw, descriptors = self._sift.detectAndCompute(image, mask)
            return raw, descriptors
        found = self._sift.detect(image, mask)
        if not found:
            return found, None
        pixels = np.array([k.pt for k in found], np.float32)
        strengths = np.array([k.response for k in found], np.float32)
        kept = spread_over_cells(pixels, strengths, (image.shape[0], image.shape[1]), self._cells)
        raw, descriptors = self._sift.compute(image, [found[row] for row in kept[:most]])
        return raw, descriptors


def spread_over_cells(
    pixels: NDArray[np.float32], strengths: NDArray[np.float32], size: tuple[int, int], cells: int
) -> NDArray[np.intp]:
    """Rows of points (N, 2): the strongest of every cell first, then the second of each, and so on.

    Args:
        pixels: (N, 2).
        strengths: (N,).
        size: height and width of the picture.
        cells: its columns and rows.
    """
    column, row = np.clip((pixels * cells / np.array(size[::-1])).astype(int), 0, cells - 1).T
    cell = row * cells + column
    by_cell = np.lexsort((-strengths, cell))
    first_of_cell = np.flatnonzero(np.diff(cell[by_cell], prepend=-1))
    turn = np.arange(len(cell)) - np.repeat(first_of_cell, np.diff(first_of_cell, append=len(cell)))
    order: NDArray[np.intp] = by_cell[np.lexsort((-strengths[by_cell], turn))]
    return order


def thin_out(pixels: NDArray[np.float32], strengths: NDArray[np.float32], min_distance_px: float) -> NDArray[np.intp]:
    """Rows of points (N, 2) that keep a distance from each other; of two too near the stronger stays.

    Args:
        pixels: (N, 2).
        strengths: (N,).
        min_distance_px: distance kept [px].
    """
    if len(pixels) == 0:
        return np.zeros(0, np.intp)
    stronger, weaker, _ = near_pairs(pixels, pixels, min_distance_px)
    rank = np.empty(len(pixels), np.intp)
    rank[np.argsort(-strengths, kind="stable")] = np.arange(len(pixels))
    pairs = np.column_stack([stronger, weaker])[rank[stronger] < rank[weaker]]
    kept = np.ones(len(pixels), bool)
    # A point gives way only to one that stays itself, so pairs go from the strongest on.
    for stronger, weaker in pairs[np.argsort(rank[pairs[:, 0]], kind="stable")].tolist():
        if kept[stronger]:
            kept[weaker] = False
    return np.flatnonzero(kept)


def far_from(pixels: NDArray[np.float32], others: NDArray[np.float32], min_distance_px: float) -> NDArray[np.bool_]:
    """Which points (N, 2) have none of the others (M, 2) within a distance [px]."""
    rows, _, squared = near_pairs(pixels, others, min_distance_px)
    far = np.ones(len(pixels), bool)
    far[rows[squared < min_distance_px**2]] = False
    return far
