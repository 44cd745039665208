"""A lens that is not what its model says, seen through landmarks whose places are known."""

from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.quality.lens_evidence import LensDeviation, LensEvidence
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose

WIDTH = 640
HEIGHT = 480
FOCAL = 240.0
IMAGES = 8
LANDMARKS = 60
PIXEL_SIGMA = 0.4


def lens(focal: float = FOCAL, cx: float = 319.5, rim: float = 0.0) -> CameraModel:
    K = np.array([[focal, 0.0, cx], [0.0, focal, 239.5], [0.0, 0.0, 1.0]])
    return camera_from_info("probe", WIDTH, HEIGHT, "equidistant", [rim, 0.0, 0.0, 0.0], K.reshape(-1))


def seen_through(true: CameraModel, believed: CameraModel) -> LensDeviation:
    """What comes of landmarks that one lens shows and another is believed to show."""
    random = np.random.default_rng(2)
    evidence = LensEvidence(believed, inlier_px=20.0)
    for _ in range(IMAGES):
        pose = exp_se3(random.normal(size=6) * 0.5)
        points_camera = random.uniform([-3.0, -2.0, 1.0], [3.0, 2.0, 6.0], (LANDMARKS, 3))
        points = points_camera @ pose[:3, :3].T + pose[:3, 3]
        pixels, valid = true.project(points_camera)
        pixels = pixels[valid] + random.normal(size=(int(valid.sum()), 2)) * PIXEL_SIGMA
        fit = fit_pose(believed, points[valid], pixels, pose, PoseFitSettings(), inlier_px=20.0, start_px=40.0)
        evidence.add(_matches(points[valid], pixels, fit.world_T_camera))
    assert evidence.images == IMAGES
    return evidence.error()


def _matches(points: Array, pixels: Array, pose: Array) -> LandmarkMatches:
    ids = np.arange(len(points), dtype=np.uint32)
    return LandmarkMatches(
        "probe", 1, 0, ids, ids, pixels.astype(np.float32), points.astype(np.float32), pose, np.eye(6), np.eye(3), 0
    )


def test_the_right_lens_shows_no_error() -> None:
    error = seen_through(lens(), lens())
    assert abs(error.scale) < 0.002
    assert error.centre < 0.002


@pytest.mark.parametrize("share", [0.02, -0.02])
def test_a_wrong_focal_length_is_measured_with_its_sign(share: float) -> None:
    error = seen_through(lens(FOCAL * (1.0 + share)), lens())
    assert error.scale == pytest.approx(share, abs=0.004)
    assert ("farther out" if share > 0.0 else "farther in") in error.text


def test_a_distortion_that_is_left_out() -> None:
    error = seen_through(lens(rim=-0.03), lens())
    assert error.scale < -0.01


def test_a_principal_point_that_is_off() -> None:
    error = seen_through(lens(cx=329.5), lens())
    assert error.centre == pytest.approx(10.0 / (WIDTH / 2.0), abs=0.005)
    assert abs(error.scale) < 0.004


def test_a_lost_image_and_one_of_few_landmarks_say_nothing() -> None:
    evidence = LensEvidence(lens(), inlier_px=2.5)
    points = np.random.default_rng(1).uniform(1.0, 2.0, (5, 3))
    pixels, _ = lens().project(points)
    few = _matches(points, pixels, np.eye(4))
    evidence.add(few)
    evidence.add(replace(few, world_T_camera=None))
    assert evidence.images == 0
