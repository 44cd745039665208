import cv2
import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.features import extract_all, extract_features

CAMERA = camera_from_info("still", 240, 200, "plumb_bob", [0.0] * 5, [300, 0, 120, 0, 300, 100, 0, 0, 1])
BLOBS = [(60.3, 50.8, 2.0), (150.6, 70.2, 4.0), (90.1, 140.7, 8.0), (190.0, 150.0, 3.0)]


@pytest.fixture
def photograph(tmp_path):
    y, x = np.mgrid[0:200, 0:240]
    image = np.full((200, 240), 40.0)
    for cx, cy, sigma in BLOBS:
        image += 150.0 * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2))
    blue_green_red = np.stack([0.2 * image, 0.5 * image, image], axis=2)
    path = tmp_path / "blobs.png"
    cv2.imwrite(str(path), np.round(blue_green_red).astype(np.uint8))
    return path


def test_blobs_are_found_where_they_are_and_as_large_as_they_are(photograph):
    features, _ = extract_features(photograph, CAMERA, 4000)
    for cx, cy, sigma in BLOBS:
        nearest = np.linalg.norm(features.pixels - [cx, cy], axis=1).argmin()
        assert features.pixels[nearest] == pytest.approx([cx, cy], abs=0.12)
        assert features.sigmas[nearest] == pytest.approx(sigma, rel=0.25)


def test_what_cannot_be_used_comes_as_its_error_and_in_order(tmp_path, photograph):
    broken = tmp_path / "broken.jpg"
    broken.write_bytes(b"\xff\xd8\xff\xe0 not a whole picture")
    small = tmp_path / "small.png"
    cv2.imwrite(str(small), np.zeros((100, 120), np.uint8))
    paths = [broken, photograph, small]
    first, second, third = extract_all(paths, {path.name: CAMERA for path in paths}, 4000, None, workers=2)
    assert isinstance(first, MapError) and "broken.jpg" in str(first)
    assert second[0].name == "blobs.png"
    assert isinstance(third, MapError) and "120x100" in str(third) and "240x200" in str(third)
