"""What has grown is saved with the map, comes back as it was, and does not pile up."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from helpers.known_keyframes import LANDMARKS, body_camera, keyframes, small_map, unknown_points
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.extendable_map import VIEWS, ExtendableMap, load_added_landmarks, make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK

CAMERA = body_camera()


def grown(reference_map: ReferenceMap, seen: Sequence[BodyKeyframe]) -> LocalMapper:
    mapper = LocalMapper(make_extendable(reference_map, 100))
    for keyframe in seen:
        mapper.add_keyframe(keyframe)
    mapper.take_changes()
    return mapper


def in_slots(growing_map: ExtendableMap) -> dict[bytes, np.ndarray]:
    """Descriptors of the first look -> place, of the slots that are filled."""
    rows = growing_map.slots_from + np.flatnonzero(growing_map.landmark_ids[growing_map.slots_from :] != NO_LANDMARK)
    looks = np.searchsorted(growing_map.descriptor_landmark, rows)
    return {growing_map.descriptors[k].tobytes(): growing_map.points_world[r] for r, k in zip(rows, looks, strict=True)}


def test_grows_is_saved_and_is_there_again(tmp_path: Path) -> None:
    reference_map, points = small_map(), unknown_points()
    mapper = grown(reference_map, keyframes(CAMERA, points))
    assert mapper.landmarks > 50
    mapper.map.compact().save(tmp_path / "grown")

    saved = ReferenceMap.load(tmp_path / "grown")
    assert (saved.grown, len(saved.landmark_ids)) == (mapper.landmarks, LANDMARKS + mapper.landmarks)
    assert len(np.unique(saved.landmark_ids)) == len(saved.landmark_ids)
    np.testing.assert_array_equal(saved.points_world[:LANDMARKS], reference_map.points_world)
    apart_m = np.linalg.norm(saved.points_world[LANDMARKS:, None] - points, axis=2).min(axis=1)
    assert apart_m.max() < 1e-3
    assert saved.descriptor_size.min() > 0.0 and len(saved.descriptors) == LANDMARKS + VIEWS * mapper.landmarks
    assert saved.photographs is not None
    assert saved.photographs.first_observation[-1] == saved.photographs.first_observation[LANDMARKS], "seen by none"

    again = LocalMapper(make_extendable(reference_map, 100))
    back = load_added_landmarks(tmp_path / "grown", reference_map, tmp_path / "map")
    assert again.restore(back) == mapper.landmarks == again.landmarks
    again.take_changes()
    before, after = in_slots(mapper.map), in_slots(again.map)
    assert before.keys() == after.keys()
    assert all(np.array_equal(before[look], after[look]) for look in before)
    again.map.compact().save(tmp_path / "twice")
    assert len(ReferenceMap.load(tmp_path / "twice").landmark_ids) == len(saved.landmark_ids), "they do not pile up"


def test_a_map_that_has_grown_from_another_is_refused(tmp_path: Path) -> None:
    grown(small_map(), keyframes(CAMERA, unknown_points())).map.compact().save(tmp_path / "grown")
    moved = small_map()
    moved.points_world[3, 0] += 0.001
    more = small_map()
    more.landmark_ids[-1] = 1000
    for other in (moved, more, make_extendable(small_map(), 500)):
        with naming(MapError, tmp_path / "grown", tmp_path / "base"):
            load_added_landmarks(tmp_path / "grown", other, tmp_path / "base")
    with naming(MapError, tmp_path / "nowhere"):
        load_added_landmarks(tmp_path / "nowhere", small_map(), tmp_path / "base")
