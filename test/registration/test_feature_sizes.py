"""What one lens says of a feature's size, another believes: written by the mapping, read by the matching."""

import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import inverse, rigid
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.landmark_descriptors import DescriptorSettings, choose_descriptors
from bodycam_ros.mapping.structure import Structure
from bodycam_ros.registration.matching import MatchingSettings, match_near_prediction
from bodycam_ros.registration.reference_map import ReferenceMap

SIZE_M = 0.02
WIDE = camera_from_info("wide", 1600, 1200, "plumb_bob", [0.0] * 5, [600, 0, 800, 0, 600, 600, 0, 0, 1])
NARROW = camera_from_info(
    "narrow", 640, 480, "rational_polynomial", [-0.2, 0.05, 0, 0, 0, 0, 0, 0], [500, 0, 320, 0, 500, 240, 0, 0, 1]
)
FISHEYE = camera_from_info("eye", 1200, 1200, "equidistant", [0.01, 0.0, 0.0, 0.0], [390, 0, 600, 0, 390, 600, 0, 0, 1])
PHOTOGRAPHED_FROM = np.eye(4)
SEEN_FROM = rigid(np.eye(3), np.array([0.3, -0.1, 0.2]))


def shown(camera, world_T_camera, points_world):
    """Which points a camera shows, their pixels, and sigmas [px] of spheres of one size, by neighbouring directions."""
    points = (points_world - world_T_camera[:3, 3]) @ world_T_camera[:3, :3]
    pixels, valid = camera.project(points)
    seen = np.flatnonzero(valid & camera.in_image(pixels))
    points = points[seen]
    along = np.cross(points, np.where(np.abs(points[:, :1]) < np.abs(points[:, 1:2]), [[1.0, 0, 0]], [[0, 1.0, 0]]))
    along *= 1e-4 / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(points, along) / np.linalg.norm(points, axis=1, keepdims=True)
    first, second = (camera.project(points + s)[0] - camera.project(points - s)[0] for s in (along, across))
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / (2e-4) ** 2  # [px^2/m^2]
    return seen, pixels[seen], SIZE_M * np.sqrt(area)


def mapped(photographer, points_world, descriptors):
    """The map of one photograph."""
    seen, pixels, sigmas = shown(photographer, PHOTOGRAPHED_FROM, points_world)
    n = len(seen)
    structure = Structure(
        names=["a.jpg"],
        cameras=(photographer,),
        camera_of_view=np.zeros(1, np.int64),
        world_T_camera=PHOTOGRAPHED_FROM[None],
        points_world=points_world[seen],
        colours=np.zeros((n, 3), np.uint8),
        observation_views=np.zeros(n, np.int64),
        observation_points=np.arange(n),
        observation_pixels=pixels,
        observation_features=np.arange(n),
    )
    image = ImageFeatures("a.jpg", pixels.astype("f4"), sigmas.astype("f4"), descriptors[seen], structure.colours)
    chosen = choose_descriptors(structure, [image], DescriptorSettings())
    reference_map = ReferenceMap(
        landmark_ids=seen.astype(np.uint32),
        points_world=structure.points_world,
        colours=structure.colours,
        descriptor_landmark=chosen.landmark,
        descriptors=chosen.descriptors,
        descriptor_view=chosen.view,
        descriptor_size=chosen.size,
        world_T_camera=structure.world_T_camera,
        image_names=("a.jpg",),
        metric=True,
        gravity_aligned=True,
    )
    return reference_map, seen


@pytest.mark.parametrize("photographer", [WIDE, FISHEYE, NARROW])
@pytest.mark.parametrize("camera", [WIDE, FISHEYE, NARROW])
def test_sizes_agree_whatever_lenses_showed_them(photographer, camera) -> None:
    rng = np.random.default_rng(6)
    directions = rng.normal(size=(1500, 3)) * [1.0, 1.0, 0.5]
    directions[:, 2] = np.abs(directions[:, 2]) + 0.05
    points = 3.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    descriptors = rng.integers(0, 90, (len(points), 128)).astype(np.uint8)
    reference_map, known = mapped(photographer, points, descriptors)
    assert reference_map.descriptor_size == pytest.approx(np.full(len(known), SIZE_M), rel=0.05)

    seen, pixels, sigmas = shown(camera, SEEN_FROM, points)
    settings = MatchingSettings(max_size_ratio=1.1)
    feature, landmark = match_near_prediction(
        reference_map, camera, SEEN_FROM, pixels, descriptors[seen], sigmas, 4.0, settings
    )
    assert np.array_equal(seen[feature], known[landmark])
    common = np.intersect1d(seen, known)
    assert len(feature) == len(common) > 30
    if photographer is camera is FISHEYE:
        angles = np.degrees(np.arccos((points[common] @ inverse(SEEN_FROM)[:3, :3].T)[:, 2] / 3.0))
        assert np.sum(angles > 65.0) > 50
    assert (
        len(
            match_near_prediction(
                reference_map, camera, SEEN_FROM, pixels, descriptors[seen], 1.2 * sigmas, 4.0, settings
            )[0]
        )
        == 0
    )
