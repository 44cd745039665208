"""Landmarks over an image whose rows were read out one after the other lie where the image shows them."""

import numpy as np
from rolling_camera import START_NS, landmarks_ahead, rolling_pixels, swinging, wide_camera

from bodycam_ros.drawing.overlay import Overlay
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches


def test_tracks_and_landmarks_lie_where_the_image_shows_them() -> None:
    camera, seconds = wide_camera(), 0.3
    pose = swinging(np.array(seconds))
    points = landmarks_ahead(80, np.random.default_rng(3)).astype(np.float32)
    shown, visible = rolling_pixels(camera, points.astype(np.float64), swinging, seconds, 0.012)
    steady, _ = camera.project(transform_points(inverse(pose), points.astype(np.float64)))
    points, shown, steady = points[visible], shown[visible], steady[visible]
    assert np.linalg.norm(shown - steady, axis=1).max() > 2.0
    ids = np.arange(len(points), dtype=np.uint32)
    matches = LandmarkMatches(
        "wide", START_NS, 0, ids, ids, steady.astype(np.float32), points, pose, np.eye(6), np.eye(3), 0,
        (shown - steady).astype(np.float32),
    )  # fmt: skip
    overlay = Overlay.of(camera, pose, (), matches)
    np.testing.assert_allclose(overlay.pixels, shown, atol=1e-3)
    np.testing.assert_allclose(overlay.projected, shown, atol=1e-3)
    assert overlay.errors.max() < 1e-3
