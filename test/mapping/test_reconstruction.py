"""Structure from motion on the photographs of the sample, where not all goes well at first."""

from contextlib import contextmanager

import numpy as np
import pytest

from bodycam_ros.geometry import umeyama
from bodycam_ros.mapping import reconstruction
from bodycam_ros.mapping.features import FeatureSettings, extract_all
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import find_photographs
from bodycam_ros.registration.reference_map import ReferenceMap

SETTINGS = MapSettings()


class Silent:
    @contextmanager
    def step(self, name, total):
        yield lambda units=1: None


@pytest.fixture(scope="module")
def photographed(sample):
    """Features of seven photographs, their cameras by name, and the pairs of all with all."""
    photographs = find_photographs(sample / "reference")
    settings = FeatureSettings(max_features=1200, contrast=0.03)
    features = list(extract_all(photographs.paths[:7], photographs.camera_of_name, settings, workers=2))
    pairs = [(i, j) for j in range(len(features)) for i in range(j)]
    return features, {image.name: photographs.camera_of_name[image.name] for image in features}, pairs


def centres_agree(names, centres, sample):
    """Whether centres are those of the sample's map, but for a similarity, to 5 mm."""
    known = ReferenceMap.load(sample / "map")
    true = np.array([known.world_T_camera[known.image_names.index(name)][:3, 3] for name in names])
    scale, R, t = umeyama(centres, true, with_scale=True)
    return np.linalg.norm(scale * centres @ R.T + t - true, axis=1).max() < 0.005


def test_where_the_largest_features_find_nothing_all_are_asked(photographed, sample, monkeypatch):
    features, camera_of_name, _ = photographed
    asked = []
    coarse_model = reconstruction._coarse_model

    def blind_at_first(features, camera_of_name, pairs, count, *others):
        asked.append(count)
        return None if len(asked) == 1 else coarse_model(features, camera_of_name, pairs, count, *others)

    monkeypatch.setattr(reconstruction, "_coarse_model", blind_at_first)
    structure = reconstruction.reconstruct(
        features, camera_of_name, SETTINGS.pairs, SETTINGS.epipolar, SETTINGS.landmarks, 2, Silent()
    )
    assert asked == [SETTINGS.pairs.registering_features, max(len(image.pixels) for image in features)]
    assert len(structure.names) == len(features)
    assert centres_agree(structure.names, structure.world_T_camera[:, :3, 3], sample)
