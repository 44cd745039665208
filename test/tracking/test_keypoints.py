"""New tracks are strong and keep their distance."""

import cv2
import numpy as np

from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings


def test_bright_clothes_over_half_of_the_picture_leave_the_room_its_keypoints() -> None:
    rng = np.random.default_rng(1)
    pattern = cv2.resize(rng.normal(size=(48, 64)), (640, 480), interpolation=cv2.INTER_CUBIC)
    contrast = np.where(np.arange(640) < 320, 50.0, 8.0)
    image = np.clip(128 + contrast * pattern, 0, 255).astype(np.uint8)
    whole = np.full_like(image, 255)
    spread = KeypointDetector(KeypointSettings(max_keypoints=100)).detect(image, whole)
    strongest = KeypointDetector(KeypointSettings(max_keypoints=100), cells=1).detect(image, whole)
    assert len(spread.pixels) <= 100 and (strongest.pixels[:, 0] > 330).mean() < 0.1
    assert (spread.pixels[:, 0] > 330).mean() > 0.3
    detector = KeypointDetector(KeypointSettings(max_keypoints=100))
    assert len(detector.detect(image, whole, lost=True).pixels) > 200
    # What is described after it was chosen is described as when all are.
    everything = KeypointDetector(KeypointSettings(max_keypoints=5000), cells=1).detect(image, whole)
    rows = [np.flatnonzero((everything.pixels == pixel).all(axis=1)) for pixel in spread.pixels]
    for descriptor, candidates in zip(spread.descriptors, rows, strict=True):
        assert (everything.descriptors[candidates] == descriptor).all(axis=1).any()


def test_an_image_of_one_pixel_has_no_keypoints() -> None:
    pixel = np.zeros((1, 1), np.uint8)
    assert len(KeypointDetector(KeypointSettings()).detect(pixel, pixel + 255).pixels) == 0
