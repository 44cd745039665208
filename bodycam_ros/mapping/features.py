"""Features of the photographs of a map, and the choice of pairs that overlap."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.boards.apriltag import FAMILIES, TagView, detect_tags
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import MapError
from bodycam_ros.progress import Advance, in_parallel
from bodycam_ros.tracking.feature_tracker import view_mask
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings

# The tracker's detector, so that descriptors agree; half of OpenCV's contrast threshold doubles the large features.
_DETECTOR = KeypointSettings(image_scale=1.0, contrast_threshold=0.02, max_keypoints=20000)
_WIDTH_PX, _MIN_SCALE = 768, 0.6  # of pictures that are searched: larger ones at 0.6 of their size cost half, and give
# the same features with a sigma over 1.5 px
_MAX_VIEW_ANGLE_DEG = 80.0  # from the optical axis; farther out a fisheye's calibration is poor

MAX_RATIO = 0.8  # of a match: distance to the nearest descriptor over that to the second nearest
_PROBES = 300  # largest features of each photograph that decide whether two overlap
_MIN_PROBE_MATCHES = 8  # fewer are chance; of pairs with a dozen four in five overlap
_MAX_PARTNERS = 16  # of each photograph that are matched in full
_SPANNING_TREES = 3  # independent ties between groups of photographs, so that one weak tie does no harm
_TAKEN = -1.0  # less than any product of positive numbers


@dataclass(frozen=True)
class ImageFeatures:
    """Features of one photograph, the largest first.

    Attributes:
        name: file name of the photograph.
        pixels: (N, 2) float32, pixel centres at integers.
        sigmas: (N,) float32, SIFT scale [px].
        descriptors: (N, 128) uint8 RootSIFT.
    """

    name: str
    pixels: NDArray[np.float32]
    sigmas: NDArray[np.float32]
    descriptors: NDArray[np.uint8]

    def largest(self, count: int) -> "ImageFeatures":
        """The ``count`` largest features alone."""
        return ImageFeatures(self.name, self.pixels[:count], self.sigmas[:count], self.descriptors[:count])


def extract_features(
    path: Path, camera: CameraModel, max_features: int, family: str | None = None
) -> tuple[ImageFeatures, list[TagView]]:
    """Find and describe the features of one photograph, and its tags of an AprilTag family.

    Raises:
        MapError: the file is not an image that OpenCV reads, or not of the size that the camera is calibrated for.
    """
    image = read_image_file(path, cv2.IMREAD_COLOR, MapError, camera)
    if image.shape[:2] != (camera.height, camera.width):
        raise MapError(
            f"{path}: has {image.shape[1]}x{image.shape[0]} pixels, but the camera is calibrated for "
            f"{camera.width}x{camera.height}; give photographs as they left the camera, and its own calibration"
        )
    gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    tags = [] if family is None else detect_tags(gray, camera, FAMILIES[family])
    scale = float(np.clip(_WIDTH_PX / camera.width, _MIN_SCALE, 1.0))
    found = KeypointDetector(replace(_DETECTOR, image_scale=scale), cells=1).detect(gray, _mask(camera))
    # Stable, so that the result does not depend on how a sort breaks ties: OpenCV repeats a point per orientation.
    kept = np.argsort(-found.scales, kind="stable")[:max_features]
    return ImageFeatures(path.name, found.pixels[kept], found.scales[kept], found.descriptors[kept]), tags


@cache
def _mask(camera: CameraModel) -> NDArray[np.uint8]:
    return view_mask(camera, _MAX_VIEW_ANGLE_DEG)


def extract_all(
    paths: Sequence[Path],
    camera_of_name: Mapping[str, CameraModel],
    max_features: int,
    family: str | None,
    workers: int,
) -> Iterator[tuple[ImageFeatures, list[TagView]] | MapError]:
    """``extract_features`` of all photographs, in order, as they get ready; the error of those that cannot be used."""

    def extract(path: Path) -> tuple[ImageFeatures, list[TagView]] | MapError:
        try:
            return extract_features(path, camera_of_name[path.name], max_features, family)
        except MapError as error:
            return error

    return in_parallel(extract, paths, workers)


def _count_mutual(first: NDArray[np.float32], second: NDArray[np.float32]) -> int:
    """How many of RootSIFT descriptors (N, 128) and (K, 128) are mutual nearest neighbours, by far."""
    if len(first) == 0 or len(second) < 2:
        return 0
    # All have about the same length, so the nearest is the one with the largest product.
    products = first @ second.T
    nearest = products.argmax(axis=1)
    rows = np.arange(len(first))
    mutual = products.argmax(axis=0)[nearest] == rows
    best = products[rows, nearest]
    products[rows, nearest] = _TAKEN
    length_squared = float(np.median(np.einsum("ij,ij->i", first, first)))
    good = mutual & (length_squared - best < MAX_RATIO**2 * (length_squared - products.max(axis=1)))
    return int(np.count_nonzero(good))


def count_common_features(features: Sequence[ImageFeatures], workers: int, advance: Advance) -> NDArray[np.int64]:
    """Counts (K, K) of mutual matches among the largest features of pairs (preemptive matching, Wu 2013, section 3).

    Each photograph's are with those before it; the others are zero.
    """
    probes = [f.descriptors[:_PROBES].astype(np.float32) for f in features]

    def counts_with_those_before(i: int) -> NDArray[np.int64]:
        counts = np.zeros(len(probes), dtype=np.int64)
        counts[:i] = [_count_mutual(probes[i], probe) for probe in probes[:i]]
        return counts

    return np.array(list(in_parallel(counts_with_those_before, range(len(probes)), workers, advance)))


def choose_pairs(counts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Pairs (i, j) of rows, i < j, from counts (K, K): the best partners of either, and ties between groups.

    Photographs of one corner may all be each other's best partners. Spanning trees of the largest counts tie such
    a group to the others.
    """
    from scipy.sparse.csgraph import minimum_spanning_tree

    counts = counts + counts.T
    # Ties go to the lower row, on every machine.
    best = np.argsort(-counts, axis=1, kind="stable")[:, :_MAX_PARTNERS]
    chosen = np.zeros(counts.shape, dtype=bool)
    np.put_along_axis(chosen, best, True, axis=1)
    candidates = np.where(counts >= _MIN_PROBE_MATCHES, counts, 0)
    chosen &= candidates > 0
    for _ in range(_SPANNING_TREES):
        tree = minimum_spanning_tree(-candidates.astype(np.float64)).toarray() != 0.0
        tree |= tree.T
        chosen |= tree
        candidates[tree] = 0
    rows, columns = np.nonzero(np.triu(chosen | chosen.T, k=1))
    return list(zip(rows.tolist(), columns.tolist(), strict=True))
