import numpy as np
import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import rigid
from bodycam_ros.mapping.epipolar_matching import match_known_poses
from bodycam_ros.mapping.features import ImageFeatures

SIZE_M = 0.01  # of every feature
NOISE_PX = 0.3
PERSPECTIVE = camera_from_info(
    "still", 1280, 960, "plumb_bob", [-0.06, 0.02, 0.0, 0.0, 0.0], [800, 0, 640, 0, 800, 480, 0, 0, 1]
)
FISHEYE = camera_from_info("eye", 1200, 1200, "equidistant", [0.0] * 4, [300, 0, 600, 0, 300, 600, 0, 0, 1])


def turned(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


POSES = np.stack([rigid(turned(0.0), np.zeros(3)), rigid(turned(-0.3), np.array([1.0, 0.2, 0.4]))])


def photograph(camera, pose, points_world, descriptors, sizes, rng):
    """What a photograph shows of points, and the row of the point that each feature is of."""
    points_camera = (points_world - pose[:3, 3]) @ pose[:3, :3]
    pixels, valid = camera.project(points_camera)
    seen = np.flatnonzero(valid & camera.in_image(pixels))
    rng.shuffle(seen)
    noisy = np.clip(descriptors[seen].astype(int) + rng.integers(-4, 5, (len(seen), 128)), 0, 255).astype(np.uint8)
    sigmas = sizes[seen] * camera.fx / np.linalg.norm(points_camera[seen], axis=1)
    pixels = (pixels[seen] + rng.normal(0.0, NOISE_PX, (len(seen), 2))).astype(np.float32)
    features = ImageFeatures("a", pixels, sigmas.astype(np.float32), noisy)
    return features, seen


def matched(camera, descriptors, poses=POSES, grown=1.0):
    """Points that each match shows in both photographs, and the points that both show."""
    rng = np.random.default_rng(8)
    points = rng.uniform([-4.0, -3.0, 3.0], [4.0, 3.0, 8.0], (len(descriptors), 3))
    sizes = np.full(len(points), SIZE_M)
    shown = [
        photograph(camera, pose, points, descriptors, size, rng)
        for pose, size in zip(POSES, (sizes, grown * sizes), strict=True)
    ]
    done = []
    (found,) = match_known_poses(
        [features for features, _ in shown],
        [camera] * 2,
        poses,
        [(0, 1)],
        1,
        lambda units=1: done.append(units),
    )
    assert done == [1]
    first, second = shown[0][1][found[:, 0]], shown[1][1][found[:, 1]]
    return first, second, np.intersect1d(shown[0][1], shown[1][1])


def root_sifts(n):
    shares = np.random.default_rng(9).dirichlet(np.full(128, 0.3), size=n)
    return np.round(512 * np.sqrt(shares)).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("camera", [PERSPECTIVE, FISHEYE])
def test_features_of_the_same_point_match_whatever_the_lens(camera):
    first, second, common = matched(camera, root_sifts(400))
    assert np.array_equal(first, second)
    assert len(first) > 0.97 * len(common) > 100


def test_repeated_texture_is_told_apart_by_the_poses():
    descriptors = np.tile(root_sifts(40), (5, 1))  # every texture at five places
    first, second, common = matched(PERSPECTIVE, descriptors)
    assert len(first) > 0.5 * len(common) and np.mean(first == second) > 0.9
