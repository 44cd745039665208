"""A camera that stands where a photograph of the sample was taken."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info, camera_from_yaml
from bodycam_ros.geometry import Array
from bodycam_ros.registration.reference_map import ReferenceMap

Image = NDArray[np.uint8]


@pytest.fixture(scope="session")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="session")
def camera(sample: Path) -> CameraModel:
    """The camera of the photographs, with a quarter of their pixels."""
    large = camera_from_yaml(sample / "reference" / "camera.yaml")
    k = [large.fx / 2, 0, (large.cx + 0.5) / 2 - 0.5, 0, large.fy / 2, (large.cy + 0.5) / 2 - 0.5, 0, 0, 1]
    return camera_from_info("door", large.width // 2, large.height // 2, "plumb_bob", large.distortion, k)


@pytest.fixture(scope="session")
def photograph(sample: Path, camera: CameraModel) -> Callable[[str], Image]:
    """A photograph in that size, by its name."""

    def read(name: str) -> Image:
        picture = cv2.imread(str(sample / "reference" / name), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        small = cv2.resize(picture, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.uint8)

    return read


@pytest.fixture(scope="session")
def taken_from(reference_map: ReferenceMap) -> Callable[[str], Array]:
    """World_T_camera (4, 4) of a photograph."""
    return lambda name: np.asarray(reference_map.world_T_camera[reference_map.image_names.index(name)])


@pytest.fixture(scope="session")
def still_images(photograph: Callable[[str], Image]) -> list[Image]:
    """What the camera sees while somebody walks by and the light goes down; the last image is black."""
    place, noise = photograph("ref_0099.jpg"), np.random.default_rng(3)
    images = []
    for brightness, left in ((1.0, 0), (0.8, 150), (0.5, 300)):
        image = np.clip(brightness * place + noise.normal(0.0, 2.0, place.shape), 0, 255).astype(np.uint8)
        image[100:, left : left + 200] = noise.integers(0, 255, (place.shape[0] - 100, 200))
        images.append(image)
    return [*images, np.zeros_like(place)]
