"""What becomes a landmark, and what does not, in a room that is known."""

from collections.abc import Iterable
from copy import deepcopy
from itertools import groupby

import numpy as np
import pytest
from helpers.grown_room import CAMERAS, FRAME_NS, elsewhere, keyframe, named, unlike, walk, walked, walls
from numpy.typing import NDArray

from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.extendable_map import make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper, MapPoint
from bodycam_ros.tracking.track_frame import NO_LANDMARK

POINTS = 500


def growth_by(keyframes: Iterable[BodyKeyframe], capacity: int = 1000) -> LocalMapper:
    mapper = LocalMapper(make_extendable(elsewhere(np.random.default_rng(9)), capacity))
    grow(mapper, keyframes)
    return mapper


def grow(mapper: LocalMapper, keyframes: Iterable[BodyKeyframe]) -> None:
    """As the cameras of a recording make it grow: with what has grown before an instant they are registered in it."""
    for _, instant in groupby(keyframes, key=lambda one: one.stamp_ns):
        for one in [named(one, mapper.map) for one in instant]:
            mapper.add_keyframe(one)
        mapper.take_changes()


def room(seed: int = 0, count: int = POINTS) -> tuple[NDArray[np.float64], NDArray[np.uint8], np.random.Generator]:
    random = np.random.default_rng(seed)
    return walls(count, random), unlike(count, random), random


def distances(mapper: LocalMapper, truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of every landmark to the true point that is nearest [m]."""
    found = np.array([point.position for point in mapper.added_points()])
    return np.linalg.norm(found[:, None] - truth[None], axis=2).min(axis=1)


@pytest.fixture(scope="module")
def grown() -> tuple[LocalMapper, NDArray[np.float64], NDArray[np.uint8]]:
    """The map after a walk of 20 instants."""
    points, looks, random = room()
    return growth_by(walk(points, looks, 20, random)), points, looks


def test_landmarks_come_out_where_the_truth_is(grown) -> None:
    mapper, points, looks = grown
    assert mapper.landmarks > 0.6 * POINTS
    errors = distances(mapper, points)
    assert np.median(errors) < 0.015 and np.percentile(errors, 95) < 0.07 and errors.max() < 0.2
    # What they look like is what those points look like.
    for point in mapper.added_points()[:50]:
        true = looks[np.linalg.norm(points - point.position, axis=1).argmin()].astype(float)
        assert np.linalg.norm(point.sightings[0].descriptor.astype(float) - true) < 60.0


def test_what_moves_becomes_no_landmark() -> None:
    """A third of the points walk along, each its own way, as fast as people do."""
    points, looks, random = room(1)
    ways = random.normal(size=(POINTS // 3, 3))
    ways *= 0.3 / np.linalg.norm(ways, axis=1, keepdims=True)
    keyframes = []
    for number in range(20):
        now = points.copy()
        now[: len(ways)] += number * ways
        for row, camera in enumerate(CAMERAS):
            stamp_ns = 1_000_000_000 + number * FRAME_NS
            keyframes.append(keyframe(camera, stamp_ns, walked(row, number), now, looks, random))
    mapper = growth_by(keyframes)
    moving = [point for point in mapper.added_points() if shows(point, looks) < len(ways)]
    # What moves along with the cameras looks like something that stands farther away.
    assert len(moving) < 0.15 * len(ways)
    assert np.median(distances(mapper, points[len(ways) :])) < 0.02


def shows(point: MapPoint, looks: NDArray[np.uint8]) -> int:
    """Which of the things a landmark looks like."""
    descriptor = point.sightings[0].descriptor.astype(float)
    return int(np.linalg.norm(looks.astype(float) - descriptor, axis=1).argmin())


def test_wrong_matches_become_no_landmarks() -> None:
    """Every point looks like two others: whatever is matched, what comes out is where something is."""
    points, looks, random = room(2)
    looks = looks[np.arange(POINTS) // 3]
    mapper = growth_by(walk(points, looks, 20, random))
    assert mapper.landmarks > 0.3 * POINTS
    assert (distances(mapper, points) < 0.1).mean() > 0.97


@pytest.mark.parametrize("capacity", [1, 7, 60])
def test_there_are_never_more_than_there_is_room_for(capacity: int) -> None:
    """Also where one image sees more than that."""
    points, looks, random = room(6, 200)
    mapper = growth_by([], capacity=capacity)
    for one in walk(points, looks, 25, random):
        mapper.add_keyframe(one)
        assert mapper.landmarks <= capacity
        mapper.take_changes()
    assert mapper.landmarks == capacity
    assert (distances(mapper, points) < 0.2).all()
    ids = mapper.map.landmark_ids[mapper.map.slots_from :]
    assert len(set(ids.tolist())) == capacity and (ids != NO_LANDMARK).all()


def test_grown_landmarks_that_are_recognised_are_refined(grown) -> None:
    """From where nobody stood before; what carries the name of a landmark is a sighting of it, and no new point."""
    mapper, points, looks = deepcopy(grown)
    random = np.random.default_rng(11)
    before = {point.landmark_id: point.position for point in mapper.added_points()}
    for height in (-0.9, -0.6, 0.6, 0.9):
        pose = walked(0, 3)
        pose[2, 3] = height
        one = named(keyframe("chest", 10**12 + round(1e9 * height), pose, points, looks, random, 0.05), mapper.map)
        assert (one.landmark_ids != NO_LANDMARK).sum() > 50
        mapper.add_keyframe(one)
    after = {point.landmark_id: point.position for point in mapper.added_points()}
    moved = [i for i in after if i in before and not np.array_equal(after[i], before[i])]
    errors = [
        np.linalg.norm(np.array([of[i] for i in moved])[:, None] - points, axis=2).min(1) for of in (before, after)
    ]
    assert len(moved) > 50 and np.median(errors[1]) < 0.7 * np.median(errors[0])
    assert len(after) < 1.1 * len(before)
