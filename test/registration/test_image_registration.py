"""Photographs of the sample registered in its map, from which they are known."""

import cv2
import numpy as np
import pytest
from helpers.reprojection import reprojection_errors

from bodycam_ros.camera import camera_from_yaml
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.registration.image_registration import ImageRegistration
from bodycam_ros.registration.reference_map import ReferenceMap


@pytest.fixture(scope="module")
def reference_map(sample):
    return ReferenceMap.load(sample / "map")


@pytest.fixture(scope="module")
def photographs(sample, reference_map):
    """The camera, and image and pose of two photographs."""
    camera = camera_from_yaml(sample / "reference" / "camera.yaml")
    shown = []
    for name in ("ref_0099.jpg", "ref_0107.jpg"):
        image = cv2.imread(str(sample / "reference" / name), cv2.IMREAD_GRAYSCALE)
        shown.append((image, reference_map.world_T_camera[reference_map.image_names.index(name)]))
    return camera, shown


def error(pose, true_pose):
    """Angle [rad] and distance [m] between two poses."""
    difference = log_se3(inverse(true_pose) @ pose)
    return np.linalg.norm(difference[:3]), np.linalg.norm(difference[3:])


def test_a_photograph_is_found_where_it_was_taken(photographs, reference_map) -> None:
    camera, shown = photographs
    registration = ImageRegistration(camera, reference_map)
    for image, true_pose in shown:
        matches = registration.register(image)
        angle, distance = error(matches.world_T_camera, true_pose)
        assert angle < np.radians(0.1) and distance < 0.005
        assert len(matches.landmark_ids) > 50
        errors = reprojection_errors(camera, matches.points_world, matches.pixels, matches.world_T_camera)
        assert np.median(errors) < 1.0


def test_what_shows_nothing_known_is_not_registered(photographs, reference_map) -> None:
    camera, ((image, _), _) = photographs
    registration = ImageRegistration(camera, reference_map)
    noise = np.random.default_rng(1).integers(0, 255, image.shape).astype(np.uint8)
    matches = registration.register(noise)
    assert matches.world_T_camera is None and np.isnan(matches.pose_covariance).all()
    assert registration.register(image, np.zeros_like(image)).world_T_camera is None
