"""Features of the photographs that a reference map is built from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.progress import in_parallel
from bodycam_ros.settings import setting
from bodycam_ros.tracking.feature_tracker import view_mask
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings

_KEYPOINTS_TO_CHOOSE_FROM = 20000  # more than a photograph has


@dataclass(frozen=True)
class FeatureSettings:
    """How features are found in photographs."""

    contrast: float = setting(
        0.02, limits=(0.001, 0.1), reason="SIFT contrast threshold; half of OpenCV's default doubles the large features"
    )
    max_features: int = setting(
        4000, unit="per photograph", limits=(500, 20000), reason="the smallest go first: body cameras do not see them"
    )
    max_view_angle_deg: float = setting(
        80.0,
        unit="deg",
        limits=(20.0, 85.0),
        reason="from the optical axis; what a fisheye shows farther out is known badly",
    )


@dataclass(frozen=True)
class ImageFeatures:
    """Features of one photograph, the largest first.

    Attributes:
        name: file name of the photograph.
        pixels: (N, 2) float32, pixel centres at integers.
        sigmas: (N,) float32, SIFT scale [px].
        descriptors: (N, 128) uint8 RootSIFT.
        colours: (N, 3) uint8 RGB of the pixel beneath.
    """

    name: str
    pixels: NDArray[np.float32]
    sigmas: NDArray[np.float32]
    descriptors: NDArray[np.uint8]
    colours: NDArray[np.uint8]

    def largest(self, count: int) -> "ImageFeatures":
        """The ``count`` largest features alone."""
        return ImageFeatures(
            self.name, self.pixels[:count], self.sigmas[:count], self.descriptors[:count], self.colours[:count]
        )


def extract_features(path: Path, camera: CameraModel, settings: FeatureSettings) -> ImageFeatures:
    """Find and describe the features of one photograph.

    Raises:
        MapError: the file is not an image that OpenCV reads, or not of the size that the camera is calibrated for.
    """
    image = read_photograph(path)
    if image.shape[:2] != (camera.height, camera.width):
        raise MapError(
            f"{path}: has {image.shape[1]}x{image.shape[0]} pixels, but the camera is calibrated for "
            f"{camera.width}x{camera.height}; give photographs as they left the camera, and its own calibration"
        )
    # The detector that the tracker uses at run time, so that descriptors agree.
    detector = KeypointDetector(
        KeypointSettings(
            image_scale=1.0,
            contrast_threshold=settings.contrast,
            max_keypoints=_KEYPOINTS_TO_CHOOSE_FROM,
            cells=1,
        )
    )
    gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    found = detector.detect(gray, _mask(camera, settings.max_view_angle_deg))
    # Stable, so that the result does not depend on how a sort breaks ties: OpenCV repeats a point per orientation.
    kept = np.argsort(-found.scales, kind="stable")[: settings.max_features]
    pixels = found.pixels[kept]
    columns, rows = np.clip(np.round(pixels).astype(int).T, 0, [[camera.width - 1], [camera.height - 1]])
    colours = np.ascontiguousarray(image[rows, columns][:, ::-1])
    return ImageFeatures(path.name, pixels, found.scales[kept], found.descriptors[kept], colours)


@cache
def _mask(camera: CameraModel, max_view_angle_deg: float) -> NDArray[np.uint8]:
    return view_mask(camera, max_view_angle_deg)


def extract_all(
    paths: Sequence[Path], camera_of_name: Mapping[str, CameraModel], settings: FeatureSettings, workers: int
) -> Iterator[ImageFeatures | MapError]:
    """Features of all photographs, in order, as they get ready; what cannot be used comes as its error."""

    def extract(path: Path) -> ImageFeatures | MapError:
        try:
            return extract_features(path, camera_of_name[path.name], settings)
        except MapError as error:
            return error

    return in_parallel(extract, paths, workers)


def read_photograph(path: Path) -> NDArray[np.uint8]:
    """Pixels (rows, columns, 3) of an image file, blue first.

    Raises:
        MapError: the file is not an image that OpenCV reads.
    """
    # Orientation tags are ignored: the calibration holds for the sensor's own rows and columns.
    try:
        image = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except (cv2.error, UnicodeEncodeError):  # a header that claims an absurd size; a name that is not UTF-8
        image = None
    if image is None:
        raise MapError(f"{path}: not a readable image; expected a whole JPEG or PNG file")
    return np.asarray(image, dtype=np.uint8)


_TAKEN = -1.0  # less than any product of positive numbers


def mutual_matches(first: NDArray[np.float32], second: NDArray[np.float32], max_ratio: float) -> NDArray[np.uint32]:
    """Pairs (M, 2) of rows of RootSIFT descriptors (N, 128) and (K, 128) that are mutual nearest neighbours.

    Args:
        first, second: the descriptors, as floats.
        max_ratio: of the distance to that to the second nearest.
    """
    if len(first) == 0 or len(second) < 2:
        return np.zeros((0, 2), np.uint32)
    # All have about the same length, so the nearest is the one with the largest product.
    products = first @ second.T
    nearest = products.argmax(axis=1)
    rows = np.arange(len(first))
    mutual = products.argmax(axis=0)[nearest] == rows
    best = products[rows, nearest]
    products[rows, nearest] = _TAKEN
    length_squared = float(np.median(np.einsum("ij,ij->i", first, first)))
    squared = 2.0 * (length_squared - best)
    second_squared = 2.0 * (length_squared - products.max(axis=1))
    good = mutual & (squared < max_ratio**2 * second_squared)
    return np.column_stack([rows[good], nearest[good]]).astype(np.uint32)


@dataclass(frozen=True)
class PairSettings:
    """How pairs of photographs are chosen, and matched before their poses are known."""

    probe_features: int = setting(
        500,
        unit="per photograph",
        limits=(50, 3000),
        reason="largest features that decide whether two photographs overlap",
    )
    probe_ratio: float = setting(
        0.8, limits=(0.5, 0.95), reason="a probe matches if its nearest descriptor is this much nearer than the second"
    )
    min_probe_matches: int = setting(
        8, limits=(1, 100), reason="fewer mutual probe matches are chance; of pairs with a dozen four in five overlap"
    )
    max_partners: int = setting(
        16, unit="per photograph", limits=(2, 500), reason="best partners of each photograph that are matched in full"
    )
    spanning_trees: int = setting(
        3, limits=(0, 10), reason="independent ties between groups of photographs, so that one weak tie does no harm"
    )
    registering_features: int = setting(
        1000,
        unit="per photograph",
        limits=(200, 20000),
        reason="largest features that find the poses, to some pixels; with all of them it takes five times as long",
    )


def probe_overlap(
    features: Sequence[ImageFeatures], settings: PairSettings, workers: int = 1
) -> Iterator[NDArray[np.int64]]:
    """Count mutual matches among the largest features of all pairs (preemptive matching, Wu 2013, section 3).

    Yields:
        for each photograph i the (K,) counts with the photographs before it, zero from itself on.
    """
    probes = [f.descriptors[: settings.probe_features].astype(np.float32) for f in features]

    def counts_with_those_before(i: int) -> NDArray[np.int64]:
        counts = np.zeros(len(probes), dtype=np.int64)
        counts[:i] = [len(mutual_matches(probes[i], probe, settings.probe_ratio)) for probe in probes[:i]]
        return counts

    return in_parallel(counts_with_those_before, range(len(probes)), workers)


def promising_pairs(counts: NDArray[np.int64], settings: PairSettings) -> list[tuple[int, int]]:
    """Pairs (i, j) of rows, i < j, from counts (K, K): the best partners of either, and what holds groups together.

    Photographs of one corner may all be each other's best partners. Spanning trees of the largest counts tie such
    a group to the others.
    """
    from scipy.sparse.csgraph import minimum_spanning_tree

    counts = counts + counts.T
    # Ties go to the lower row, on every machine.
    best = np.argsort(-counts, axis=1, kind="stable")[:, : settings.max_partners]
    chosen = np.zeros(counts.shape, dtype=bool)
    np.put_along_axis(chosen, best, True, axis=1)
    candidates = np.where(counts >= settings.min_probe_matches, counts, 0)
    chosen &= candidates > 0
    for _ in range(settings.spanning_trees):
        tree = minimum_spanning_tree(-candidates.astype(np.float64)).toarray() != 0.0
        tree |= tree.T
        chosen |= tree
        candidates[tree] = 0
    rows, columns = np.nonzero(np.triu(chosen | chosen.T, k=1))
    return list(zip(rows.tolist(), columns.tolist(), strict=True))
