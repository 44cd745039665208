"""A lens of each model, boards, and what a faultless detector finds of a board."""

import cv2
import numpy as np

from bodycam_ros.boards.board_detector import BoardView
from bodycam_ros.boards.board_layout import BoardLayout
from bodycam_ros.camera import camera_from_info
from helpers.rendered_board import held_poses

_TAGS = cv2.aruco.DICT_APRILTAG_36h11

CHARUCO = BoardLayout("charuco", 8, 5, (0.033, 0.033), (0.02475, 0.02475), _TAGS)

LENSES = {
    "fov": camera_from_info("f", 640, 480, "fov", [0.95], [300, 0, 324, 0, 300, 236, 0, 0, 1]),
    "equidistant": camera_from_info(
        "e", 640, 480, "equidistant", [0.02, -0.01, 0.003, -0.001], [233, 0, 321.5, 0, 233.6, 238.2, 0, 0, 1]
    ),
    "plumb_bob": camera_from_info(
        "p", 640, 480, "plumb_bob", [-0.25, 0.08, 0.0008, -0.0006, -0.01], [420, 0, 318, 0, 421, 243, 0, 0, 1]
    ),
    "rational_polynomial": camera_from_info(
        "r",
        640,
        480,
        "rational_polynomial",
        [0.5, 0.06, 0.0005, 0.0004, 0.002, 0.8, 0.17, 0.01],
        [380, 0, 316, 0, 380.5, 241, 0, 0, 1],
    ),
}


def views_of(camera, poses, points, noise_px=0.02, seed=1):
    """What is in the picture of the points (N, 3) of a board, with noise."""
    random = np.random.default_rng(seed)
    views = []
    for number, pose in enumerate(poses):
        pixels, valid = camera.project(points @ pose[:3, :3].T + pose[:3, 3])
        seen = valid & camera.in_image(pixels)
        if seen.sum() >= 8:
            noisy = pixels[seen] + random.normal(0.0, noise_px, (int(seen.sum()), 2))
            views.append(BoardView(str(number), points[seen], noisy, np.ones(len(noisy)), 0.4))
    return views


def held(camera, count=30, size=0.6):
    """Sights of a ChArUco board that is held everywhere."""
    return views_of(camera, held_poses(camera, CHARUCO, count, size=size), CHARUCO.inner_corners)
