import numpy as np
import pytest
from helpers.small_structure import small_structure

from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.structure import choose_descriptors


def photographs(structure):
    """Photographs whose descriptors start with their own number and the number of the point."""
    features = []
    for view, name in enumerate(structure.names):
        n = len(structure.points_world)
        descriptors = np.zeros((n, 128), np.uint8)
        descriptors[:, 0], descriptors[:, 1] = view, np.arange(n)
        sigmas = np.full(n, 2.0 + view, np.float32)
        features.append(ImageFeatures(name, np.zeros((n, 2), "f4"), sigmas, descriptors))
    return features


def test_directions_point_to_the_camera_and_sizes_predict_the_sigma():
    structure = small_structure()
    chosen = choose_descriptors(structure, photographs(structure))
    names = ("descriptor_landmark", "descriptors", "descriptor_view", "descriptor_size")
    for landmark, descriptor, view, size in zip(*(chosen[name] for name in names), strict=True):
        pose = structure.world_T_camera[descriptor[0]]
        offset = pose[:3, 3] - structure.points_world[landmark]
        assert view == pytest.approx(offset / np.linalg.norm(offset), abs=1e-6)
        # Two points a little to either side and two above and below: how far apart the lens shows them.
        camera = structure.cameras[structure.camera_of_view[descriptor[0]]]
        seen = -offset @ pose[:3, :3]
        aside = np.linalg.svd(seen[None])[2][1:]
        pixels = camera.project(seen + 1e-5 * np.concatenate([aside, -aside]))[0]
        per_metre = np.sqrt(abs(np.linalg.det(pixels[:2] - pixels[2:]))) / 2e-5
        assert size * per_metre == pytest.approx(2.0 + descriptor[0], rel=2e-3)
