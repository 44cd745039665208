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
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings
from bodycam_ros.tracking.view_mask import view_mask

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
