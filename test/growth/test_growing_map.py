"""Room behind the landmarks of a map: unseen while it is empty, and nobody takes one landmark for the one before it."""

from dataclasses import replace

import numpy as np
import pytest
from grown_room import CAMERA, unlike
from rolling_camera import START_NS, landmarks_ahead, map_of, track_frames, wide_camera

from bodycam_ros.growth.growing_map import LOOKS, GrowingMap, GrownLandmarks, growing
from bodycam_ros.registration.local_landmarks import LocalLandmarks
from bodycam_ros.registration.matching import MatchingSettings, match_by_looks, match_near_prediction
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.track_frame import NO_LANDMARK

CAPACITY = 6
SETTINGS = MatchingSettings()


@pytest.fixture
def reference_map() -> ReferenceMap:
    random = np.random.default_rng(3)
    return replace(map_of(landmarks_ahead(260, random), random), descriptors=unlike(260, random))


def grown(
    grown_map: GrowingMap, slots: list[int], points: np.ndarray, looks: np.ndarray, turn: int = 0
) -> GrownLandmarks:
    """Landmarks that a camera in the origin sees; the so-manieth of their slots."""
    count = len(slots)
    views = np.repeat((-points / np.linalg.norm(points, axis=1)[:, None])[:, None], LOOKS, axis=1)
    return GrownLandmarks(
        slots=np.array(slots),
        landmark_ids=np.array([grown_map.first_id + slot + turn * grown_map.capacity for slot in slots], np.uint32),
        points_world=points,
        descriptors=np.repeat(looks[:, None], LOOKS, axis=1),
        views=views.astype(np.float32),
        sizes=np.full((count, LOOKS), 0.1, np.float32),
    )


def gone(grown_map: GrowingMap, slots: list[int]) -> GrownLandmarks:
    taken = grown(grown_map, slots, np.ones((len(slots), 3)), np.zeros((len(slots), 128), np.uint8))
    return replace(taken, landmark_ids=np.full(len(slots), NO_LANDMARK, np.uint32))


def all_features(points: np.ndarray, looks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels, descriptors and scales with which a camera in the origin sees points (N, 3)."""
    pixels, valid = CAMERA.project(points)
    distances = np.linalg.norm(points, axis=1)
    assert valid.all()
    return pixels, looks, 0.1 * CAMERA.fx / distances


@pytest.mark.parametrize("asked_before", [False, True])
def test_what_has_grown_is_found_like_any_landmark_and_not_when_it_has_gone(
    reference_map: ReferenceMap, asked_before: bool
) -> None:
    """Near its place and by its looks alone, whether a camera was lost before it came or after."""
    grown_map = growing(reference_map, CAPACITY)
    random = np.random.default_rng(5)
    points, looks = landmarks_ahead(40, random), unlike(40, random)
    points = points[CAMERA.in_image(CAMERA.project(points)[0]) & (points[:, 2] > 1.0)][:4]
    looks, slots = looks[:4], [1, 2, 4, 5]
    if asked_before:
        match_by_looks(grown_map, looks, None, SETTINGS)
    grown_map.take(grown(grown_map, slots, points, looks))
    pixels, descriptors, scales = all_features(points, looks)
    expected = grown_map.slots_from + np.array(slots)
    near = match_near_prediction(grown_map, CAMERA, np.eye(4), pixels, descriptors, scales, 2.0, SETTINGS)
    np.testing.assert_array_equal(near, [np.arange(4), expected])
    np.testing.assert_array_equal(match_by_looks(grown_map, looks, None, SETTINGS), [np.arange(4), expected])
    assert set(expected.tolist()) <= set(LocalLandmarks(grown_map.grid, CAMERA.fx, 1.0).around(np.zeros(3)).tolist())
    grown_map.take(gone(grown_map, [2, 5]))
    near = match_near_prediction(grown_map, CAMERA, np.eye(4), pixels, descriptors, scales, 2.0, SETTINGS)
    np.testing.assert_array_equal(near, [[0, 2], expected[[0, 2]]])
    np.testing.assert_array_equal(match_by_looks(grown_map, looks, None, SETTINGS), [[0, 2], expected[[0, 2]]])


def test_a_registrar_goes_by_what_has_grown_alone(reference_map: ReferenceMap) -> None:
    """All that is before the camera has grown; then half of it goes, and other things take its place."""
    random = np.random.default_rng(7)
    far = map_of(landmarks_ahead(20, random) + np.array([500.0, 0.0, 0.0]), random)
    grown_map = growing(replace(far, descriptors=unlike(20, random)), len(reference_map.landmark_ids))
    everything = list(range(len(reference_map.landmark_ids)))
    now = grown(grown_map, everything, reference_map.points_world, reference_map.descriptors)
    sizes = np.repeat(reference_map.descriptor_size[:, None], LOOKS, axis=1)
    grown_map.take(replace(now, sizes=sizes))
    registrar = Registrar(wide_camera(), grown_map)
    frames = list(track_frames(wide_camera(), reference_map, np.random.default_rng(4), 0.0, 20))
    for number, frame in enumerate(frames):
        if number == 5:
            half = everything[::2]
            others = grown(grown_map, half, reference_map.points_world[half] + 40.0, unlike(len(half), random), turn=1)
            grown_map.take(others)
        matches = registrar.register(frame)
        assert matches.world_T_camera is not None and matches.grown == len(matches.landmark_ids) > 20
        rows, known = grown_map.rows_of(matches.landmark_ids)
        assert known.all()
        if number >= 5:
            assert set((rows - grown_map.slots_from) % 2) == {1}
    assert frames[0].stamp_ns == START_NS
