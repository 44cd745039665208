"""Where a camera stands, by images that are photographs of the sample's map with people and darkness added."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from helpers.naming import naming
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import StaticCameraError
from bodycam_ros.geometry import Array, exp_so3, inverse, log_se3
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.static_camera_registration import StaticCameraRegistration

Image = NDArray[np.uint8]
PLACE = "ref_0099.jpg"


def error(pose: Array, true_pose: Array) -> tuple[float, float]:
    """Angle [deg] and distance [mm] between two poses."""
    apart = log_se3(inverse(true_pose) @ pose)
    return float(np.degrees(np.linalg.norm(apart[:3]))), float(1e3 * np.linalg.norm(apart[3:]))


def turned(image: Image, camera: CameraModel, turn_deg: float) -> Image:
    """What the camera would see after a turn to the side; its lens hardly distorts."""
    k = np.array(camera.k).reshape(3, 3)
    warp = k @ exp_so3(np.array([0.0, np.radians(turn_deg), 0.0])) @ np.linalg.inv(k)
    return np.asarray(cv2.warpPerspective(image, warp, image.shape[::-1]), np.uint8)


def test_a_camera_is_found_where_it_stands(
    camera: CameraModel,
    reference_map: ReferenceMap,
    still_images: list[Image],
    taken_from: Callable[[str], Array],
) -> None:
    found = StaticCameraRegistration(camera, reference_map).register(still_images)
    angle_deg, distance_mm = error(found.station.world_T_camera, taken_from(PLACE))
    assert angle_deg < 0.05 and distance_mm < 3.0
    assert found.station.name == "door" and found.station.camera is camera
    assert (found.images, found.asked) == (3, 4)
    assert found.landmarks > 300 and found.error_px < 0.8
    assert 0.1 < found.sigma_mm < 3.0 and 0.001 < found.sigma_deg < 0.05


def test_a_map_without_photographs_does_by_descriptors(
    camera: CameraModel,
    reference_map: ReferenceMap,
    still_images: list[Image],
    taken_from: Callable[[str], Array],
) -> None:
    bare = replace(reference_map, photographs=None)
    found = StaticCameraRegistration(camera, bare).register(still_images)
    angle_deg, distance_mm = error(found.station.world_T_camera, taken_from(PLACE))
    assert angle_deg < 0.15 and distance_mm < 10.0
    assert found.images == 3 and found.landmarks > 50


@pytest.mark.parametrize("turn_deg", [0.4, 12.0])
def test_a_camera_that_somebody_bumped_into_moves(
    camera: CameraModel, reference_map: ReferenceMap, still_images: list[Image], turn_deg: float
) -> None:
    images = [*still_images[:2], turned(still_images[2], camera, turn_deg)]
    with naming(StaticCameraError, "camera door"):
        StaticCameraRegistration(camera, reference_map).register(images)


def test_what_cannot_be_placed_says_what_to_do(
    camera: CameraModel, reference_map: ReferenceMap, still_images: list[Image]
) -> None:
    registration = StaticCameraRegistration(camera, reference_map)
    noise = np.random.default_rng(1).integers(0, 255, still_images[0].shape).astype(np.uint8)
    with naming(StaticCameraError, "camera door", "0 of its 2 images"):
        registration.register([noise, still_images[3]])
    with naming(StaticCameraError, "camera door", "1 of its 2 images"):
        registration.register([still_images[0], noise])
    with naming(StaticCameraError, "camera door", 1, 2):
        registration.register(still_images[:1])
