"""What has grown is saved with the map, comes back as it was, and does not pile up."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_keyframes import LANDMARKS, keyframes, small_map, unknown_points, worn_camera

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import MapError
from bodycam_ros.growth.growing_map import LOOKS, GrowingMap, GrownLandmarks, growing
from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.map_growth import MapGrowth
from bodycam_ros.growth.saved_growth import load_growth
from bodycam_ros.growth.worn_keyframe import WornKeyframe
from bodycam_ros.pipeline import PipelineSettings, landmark_tracker, registrar
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK

CAMERA = worn_camera()


def grown(
    reference_map: ReferenceMap, seen: Sequence[WornKeyframe], settings: GrowthSettings | None = None
) -> MapGrowth:
    settings = settings or GrowthSettings(capacity=100)
    growth = MapGrowth(growing(reference_map, settings.capacity), {CAMERA.name: CAMERA}, settings)
    for keyframe in seen:
        growth.add(keyframe)
    growth.take_changes()
    return growth


def in_slots(growing_map: GrowingMap) -> dict[bytes, np.ndarray]:
    """Descriptors of the first look -> place, of the slots that are filled."""
    rows = growing_map.slots_from + np.flatnonzero(growing_map.landmark_ids[growing_map.slots_from :] != NO_LANDMARK)
    looks = np.searchsorted(growing_map.descriptor_landmark, rows)
    return {growing_map.descriptors[k].tobytes(): growing_map.points_world[r] for r, k in zip(rows, looks, strict=True)}


def test_grows_is_saved_and_is_there_again(tmp_path: Path) -> None:
    reference_map, points = small_map(), unknown_points()
    growth = grown(reference_map, keyframes(CAMERA, points))
    assert growth.landmarks > 50
    growth.map.settled().save(tmp_path / "grown")

    saved = ReferenceMap.load(tmp_path / "grown")
    assert (saved.grown, len(saved.landmark_ids)) == (growth.landmarks, LANDMARKS + growth.landmarks)
    assert len(np.unique(saved.landmark_ids)) == len(saved.landmark_ids)
    np.testing.assert_array_equal(saved.points_world[:LANDMARKS], reference_map.points_world)
    apart_m = np.linalg.norm(saved.points_world[LANDMARKS:, None] - points, axis=2).min(axis=1)
    assert apart_m.max() < 1e-3
    assert saved.descriptor_size.min() > 0.0 and len(saved.descriptors) == LANDMARKS + LOOKS * growth.landmarks
    assert saved.photographs is not None
    assert saved.photographs.first_observation[-1] == saved.photographs.first_observation[LANDMARKS], "seen by none"

    again = MapGrowth(growing(reference_map, 100), {CAMERA.name: CAMERA})
    back = load_growth(tmp_path / "grown", reference_map, tmp_path / "map")
    assert again.remember(back) == growth.landmarks == again.landmarks
    again.take_changes()
    before, after = in_slots(growth.map), in_slots(again.map)
    assert before.keys() == after.keys()
    assert all(np.array_equal(before[look], after[look]) for look in before)
    again.map.settled().save(tmp_path / "twice")
    assert len(ReferenceMap.load(tmp_path / "twice").landmark_ids) == len(saved.landmark_ids), "they do not pile up"


def test_what_came_back_is_culled_and_gives_way_like_all_others(tmp_path: Path) -> None:
    reference_map = small_map()
    growth = grown(reference_map, keyframes(CAMERA, unknown_points(30)))
    growth.map.settled().save(tmp_path / "grown")
    back = load_growth(tmp_path / "grown", reference_map, tmp_path / "map")

    settings = GrowthSettings(capacity=100)
    again = MapGrowth(growing(reference_map, settings.capacity), {CAMERA.name: CAMERA}, settings)
    again.remember(back)
    again.take_changes()
    wrong = again.map.slots_from
    matches = LandmarkMatches(
        camera=CAMERA.name,
        stamp_ns=1,
        previous_stamp_ns=0,
        track_ids=np.zeros(1, np.uint32),
        landmark_ids=again.map.landmark_ids[wrong : wrong + 1].copy(),
        pixels=np.array([[5.0, 5.0]], np.float32),
        points_world=again.map.points_world[wrong : wrong + 1].astype(np.float32),
        world_T_camera=np.eye(4),
        pose_covariance=np.eye(6),
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )
    for _ in range(settings.max_strikes):
        again.hear(matches)
    again.take_changes()
    assert again.landmarks == growth.landmarks - 1
    assert again.map.landmark_ids[wrong] == NO_LANDMARK

    # In a map that has no more room the newly grown take the place of what nobody has seen in this run.
    full = MapGrowth(growing(reference_map, growth.landmarks), {CAMERA.name: CAMERA}, settings)
    full.remember(back)
    full.take_changes()
    remembered = set(in_slots(full.map))
    for keyframe in keyframes(CAMERA, unknown_points(20, seed=8), seed=8):
        full.add(keyframe)
    full.take_changes()
    assert full.landmarks == growth.landmarks
    assert 15 <= len(set(in_slots(full.map)) - remembered) <= 20


def test_what_comes_back_is_seen_and_stays_where_it_was(tmp_path: Path) -> None:
    reference_map, points = small_map(), unknown_points(30)
    growth = grown(reference_map, keyframes(CAMERA, points))
    growth.map.settled().save(tmp_path / "grown")
    again = grown(reference_map, [])
    again.remember(load_growth(tmp_path / "grown", reference_map, tmp_path / "map"))
    again.take_changes()
    ids = dict.fromkeys(range(len(points)), int(NO_LANDMARK))
    for row in again.map.slots_from + np.arange(again.landmarks):
        ids[int(np.linalg.norm(points - again.map.points_world[row], axis=1).argmin())] = again.map.landmark_ids[row]
    before = in_slots(again.map)
    for keyframe in keyframes(CAMERA, points, start=4):
        again.add(replace(keyframe, landmark_ids=np.array([ids[row] for row in range(len(points))], np.uint32)))
    again.take_changes()
    after = in_slots(again.map)
    assert all(np.array_equal(before[look], after[look]) for look in before)
    assert again.landmarks == growth.landmarks, "nothing is there twice"


def test_forgotten_landmarks_are_gone_and_their_ids_are_not_used_again() -> None:
    growth = grown(small_map(), keyframes(CAMERA, unknown_points(30)))
    ids = set(growth.map.landmark_ids.tolist())
    growth.forget()
    growth.take_changes()
    assert (growth.landmarks, growth.keyframes) == (0, 0)
    assert set(growth.map.landmark_ids[growth.map.slots_from :].tolist()) == {int(NO_LANDMARK)}
    assert len(growth.map.settled().landmark_ids) == LANDMARKS
    for keyframe in keyframes(CAMERA, unknown_points(30)):
        growth.add(keyframe)
    growth.take_changes()
    new = set(growth.map.landmark_ids[growth.map.slots_from :].tolist()) - {int(NO_LANDMARK)}
    assert len(new) > 25 and not new & ids


def test_a_map_that_has_grown_from_another_is_refused(tmp_path: Path) -> None:
    grown(small_map(), keyframes(CAMERA, unknown_points())).map.settled().save(tmp_path / "grown")
    moved = small_map()
    moved.points_world[3, 0] += 0.001
    more = small_map()
    more.landmark_ids[-1] = 1000
    for other in (moved, more, growing(small_map(), 500)):
        with pytest.raises(MapError, match=r"grown: this map has grown from another one than .*base; give the map"):
            load_growth(tmp_path / "grown", other, tmp_path / "base")
    with pytest.raises(MapError, match="no map folder"):
        load_growth(tmp_path / "nowhere", small_map(), tmp_path / "base")


def test_photographs_are_asked_as_if_nothing_had_grown(sample: Path) -> None:
    """A tracker that is given the saved map finds the same landmarks, though others lie in the same places."""
    reference_map = ReferenceMap.load(sample / "map")
    growing_map = growing(reference_map, 400)
    rows = np.arange(0, 8000, 20)
    looks = np.searchsorted(reference_map.descriptor_landmark, rows)
    growing_map.take(
        GrownLandmarks(
            np.arange(400),
            (growing_map.first_id + np.arange(400)).astype(np.uint32),
            reference_map.points_world[rows],
            np.repeat(reference_map.descriptors[looks, None], LOOKS, axis=1),
            np.repeat(reference_map.descriptor_view[looks, None], LOOKS, axis=1),
            np.repeat(2.0 * reference_map.descriptor_size[looks, None], LOOKS, axis=1),
        )
    )
    with open_recording(sample / "sample" / "bag") as recording:
        camera = recording.camera_model("shin_left")
        images = [image for image, _ in zip(recording.images(["shin_left"]), range(5), strict=False)]
    settled = growing_map.settled()
    assert settled.photographs is not None
    trackers = [landmark_tracker(camera, each, PipelineSettings()) for each in (reference_map, settled)]
    registering = registrar(camera, reference_map, PipelineSettings())
    direct = 0
    for image in images:
        frame, other = (tracker.track(decode_grey(image), image.stamp_ns) for tracker in trackers)
        np.testing.assert_array_equal(frame.pixels, other.pixels)
        assert (frame.landmark_ids is None) == (other.landmark_ids is None)
        if frame.landmark_ids is not None and other.landmark_ids is not None:
            np.testing.assert_array_equal(frame.landmark_ids, other.landmark_ids)
            direct += len(frame.landmark_ids)
        matches = registering.register(frame)
        for tracker in trackers:
            tracker.hear(matches)
    assert direct > 100

    # Nor does it find them where they face the camera: without a photograph there is nothing to compare with.
    facing = settled.photographs.normals.copy()
    facing[-400:] = settled.descriptor_view[-2 * 400 :: 2]
    turned = replace(settled, photographs=replace(settled.photographs, normals=facing))
    tracker, names = landmark_tracker(camera, turned, PipelineSettings()), np.zeros(0, np.uint32)
    registering = registrar(camera, reference_map, PipelineSettings())
    for image in images:
        frame = tracker.track(decode_grey(image), image.stamp_ns)
        names = np.concatenate([names, frame.landmark_ids if frame.landmark_ids is not None else names[:0]])
        tracker.hear(registering.register(frame))
    assert len(names) > 100
    assert set(names.tolist()) <= {*reference_map.landmark_ids.tolist(), int(NO_LANDMARK)}
