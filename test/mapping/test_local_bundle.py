"""Keyframes and their points are adjusted between reference landmarks that stay (A 4.1), in a room that is known."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.grown_room import CAMERA, FRAME_NS, elsewhere, keyframe, unlike, walked, walls
from numpy.typing import NDArray

from bodycam_ros.geometry import exp_se3, inverse, log_se3, transform_points
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.extendable_map import make_extendable
from bodycam_ros.mapping.local_bundle import KeyframeBundle
from bodycam_ros.mapping.local_mapper import LocalMapper, View

Array = NDArray[np.float64]

FRAMES, CAMERAS = 12, ("chest", "hip", "shin")
POSE_SIGMAS = np.repeat([0.001, 0.004], 3)
"""[rad], [m] errors of the poses that keyframes are registered with."""


Poses = dict[tuple[str, int], Array]


def off_keyframes(references: int) -> tuple[list[BodyKeyframe], Array, Poses]:
    """Keyframes with poses that err, which see so many reference landmarks; the true points of the room, and poses."""
    random = np.random.default_rng(3)
    points, landmarks = walls(500, random), walls(references, random)
    looks = unlike(len(points), random)
    made, poses = [], {}
    for number in range(FRAMES):
        for row, camera in enumerate(CAMERAS):
            true = walked(row, number)
            one = keyframe(camera, 1_000_000_000 + number * FRAME_NS, true, points, looks, random)
            pixels, valid = CAMERA.project(transform_points(inverse(true), landmarks))
            shown = np.flatnonzero(valid & CAMERA.in_image(np.nan_to_num(pixels, nan=-1.0)))
            bearings, _ = CAMERA.unproject(pixels[shown] + 0.3 * random.normal(size=(len(shown), 2)))
            one = replace(
                one,
                matched_ids=shown.astype(np.uint32),
                matched_points=landmarks[shown],
                matched_rays=bearings @ true[:3, :3].T,
            )
            made.append(one.moved_to(true @ exp_se3(POSE_SIGMAS * random.normal(size=6))))
            poses[camera, one.stamp_ns] = true
    return made, points, poses


def mapper_of(keyframes: list[BodyKeyframe]) -> LocalMapper:
    # The ids of the map's own landmarks are below those of its slots; so are those that keyframes are anchored by.
    reference = elsewhere(np.random.default_rng(9))
    mapper = LocalMapper(make_extendable(replace(reference, landmark_ids=reference.landmark_ids + 1000), 1000))
    for one in keyframes:
        mapper.add_keyframe(one)
    return mapper


def pose_errors(mapper: LocalMapper, true: Poses) -> tuple[float, float]:
    """Mean errors of the keyframes' places [m] and rotations [rad]."""
    found = mapper.image_poses()
    assert len(found) > 0.8 * len(true)
    off = [log_se3(inverse(true[image]) @ pose) for image, pose in found.items()]
    turn, place = np.linalg.norm(np.reshape(off, (-1, 2, 3)), axis=2).mean(axis=0)
    return float(place), float(turn)


def point_error(mapper: LocalMapper, points: Array) -> float:
    """Median distance of a landmark to the true point that is nearest [m]."""
    found = np.array([point.position for point in mapper.added_points()])
    return float(np.median(np.linalg.norm(found[:, None] - points[None], axis=2).min(axis=1)))


def test_poses_and_landmarks_come_nearer_to_the_truth() -> None:
    keyframes, points, true = off_keyframes(references=40)
    mapper = mapper_of(keyframes)
    (place, turn), off = pose_errors(mapper, true), point_error(mapper, points)
    mapper.adjust()
    place_after, turn_after = pose_errors(mapper, true)
    assert place_after < 0.5 * place and turn_after < 0.6 * turn
    assert point_error(mapper, points) < 0.7 * off
    # What other processes are sent is what was adjusted, and features turn with their images.
    changes = mapper.take_changes()
    assert changes is not None and len(changes) >= mapper.landmarks
    for row, point in enumerate(mapper.added_points()[:20]):
        assert np.array_equal(mapper.map.points_world[mapper.map.slots_from + point.slot], point.position), row


def test_the_same_keyframes_give_the_same_bits() -> None:
    keyframes, _, _ = off_keyframes(references=40)
    results = []
    for _ in range(2):
        mapper = mapper_of(keyframes)
        mapper.adjust()
        results.append((np.array([*mapper.image_poses().values()]), [p.position for p in mapper.added_points()]))
    assert np.array_equal(results[0][0], results[1][0]) and np.array_equal(results[0][1], results[1][1])


@pytest.mark.parametrize(("references", "is_free", "moves"), [(30, True, True), (30, False, False), (5, True, False)])
def test_views_move_that_may_and_that_enough_landmarks_tie(references: int, is_free: bool, moves: bool) -> None:
    """A view of few landmarks keeps the pose that it was registered with: it would be free to go anywhere."""
    true, off = walked(0, 0), walked(0, 0) @ exp_se3(np.array([0.002, 0.0, 0.0, 0.0, 0.01, 0.0]))
    random = np.random.default_rng(0)
    rays = random.normal(size=(references, 3)) + np.array([0.0, 0.0, 3.0])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    places = transform_points(true, random.uniform(2.0, 4.0, (references, 1)) * rays)
    view = View("hip", 0, 200.0, off)
    bundle = KeyframeBundle([])
    bundle.anchor(view, np.arange(references, dtype=np.uint32), places, rays)
    bundle.solve([view] if is_free else [])
    if moves:
        np.testing.assert_allclose(view.world_T_camera, true, atol=1e-4)
    else:
        assert np.array_equal(view.world_T_camera, off)
