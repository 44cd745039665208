"""Places: a picture is most like those that show the same things."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.registration.giver_kernels import givers_of_looks
from bodycam_ros.registration.map_search import MapSearch
from bodycam_ros.registration.place_memory import PlaceMemory
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.visual_words import VisualWords


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    """The sample's map."""
    return ReferenceMap.load(sample / "map")


def test_half_of_a_place_is_most_like_the_whole() -> None:
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 90, (150, 60, 128)).astype(np.uint8)
    places = PlaceMemory(VisualWords.learn(pictures.reshape(-1, 128)))
    for number, picture in enumerate(pictures):
        places.add(picture, np.array([number, number + 1]))
    assert len(places) == 150
    for number in range(0, 150, 7):
        other = pictures[(number + 1) % 150]
        mixed = np.concatenate([pictures[number, :40], other[40:]])
        similar = places.similar(
            np.clip(mixed.astype(int) + rng.integers(-3, 4, mixed.shape), 0, 255).astype(np.uint8), 2
        )
        assert similar.tolist() == [number, (number + 1) % 150]
    assert places.seen_from(np.array([9, 4, 3])).tolist() == [3, 4, 5, 9, 10]
    assert len(places.similar(pictures[0], 1000)) == 150
    assert places.similar(pictures[0][:0], 3).shape == (3,)


def search_of(reference_map: ReferenceMap, with_photographs: bool) -> MapSearch:
    return MapSearch(
        reference_map.points_world,
        reference_map.descriptors,
        reference_map.descriptor_landmark,
        reference_map.descriptor_view,
        len(reference_map.descriptors),
        reference_map.world_T_camera,
        reference_map.photographs if with_photographs else None,
    )


def test_the_photographs_of_a_map_are_its_places(reference_map: ReferenceMap) -> None:
    """Whether their pictures were kept or not, and the landmarks that each sees."""
    with_pictures, without = search_of(reference_map, True), search_of(reference_map, False)
    photographs = reference_map.photographs
    assert photographs is not None
    assert len(with_pictures.places) == len(without.places) == len(reference_map.image_names)
    centres = np.ascontiguousarray(reference_map.world_T_camera[:, :3, 3])
    landmark = reference_map.descriptor_landmark.astype(np.int64)
    tables = (reference_map.points_world, landmark, reference_map.descriptor_view.astype(np.float64), centres)
    nobody = np.zeros(0, np.int64)
    givers = givers_of_looks(*tables, nobody, nobody)
    among = givers_of_looks(*tables, photographs.first_observation, photographs.observation_view.astype(np.int64))
    np.testing.assert_array_equal(givers, among)
    for place in range(0, len(centres), 9):
        looks = np.flatnonzero(givers == place)
        towards = centres[place] - reference_map.points_world[landmark[looks]]
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        np.testing.assert_allclose(towards, reference_map.descriptor_view[looks], atol=1e-5)
        of_place = np.array([place])
        shown = with_pictures.places.seen_from(of_place)
        observed = photographs.observation_landmark[photographs.observation_view == place]
        np.testing.assert_array_equal(shown, np.unique(observed))
        given = without.places.seen_from(of_place)
        assert set(given) == set(landmark[looks]) <= set(shown)
        assert with_pictures.places.similar(reference_map.descriptors[looks], 1)[0] == place


def test_a_map_that_knows_no_photograph_has_no_place(reference_map: ReferenceMap) -> None:
    search = MapSearch(
        reference_map.points_world,
        reference_map.descriptors,
        reference_map.descriptor_landmark,
        reference_map.descriptor_view,
        len(reference_map.descriptors),
        np.zeros((0, 4, 4)),
        None,
    )
    assert len(search.places) == 0
    looks = reference_map.descriptors[5000:5010]
    rows, best, _ = search.index.nearest(looks, 16)
    np.testing.assert_array_equal(rows, reference_map.descriptor_landmark[5000:5010])
    assert best.max() == 0.0
