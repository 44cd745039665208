"""A map with what has grown: as it was before, and more behind it, which direct registration finds."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.grown_room import CAMERA, cameras, elsewhere, unlike, walk, walls

from bodycam_ros.mapping.extendable_map import VIEWS, make_extendable
from bodycam_ros.mapping.local_mapper import KeptImage, LocalMapper
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap


def grey(seed: int) -> bytes:
    noise = np.random.default_rng(seed).integers(0, 256, (CAMERA.height // 8, CAMERA.width // 8), np.uint8)
    picture = cv2.resize(noise, (CAMERA.width, CAMERA.height))
    return bytes(cv2.imencode(".jpg", picture)[1].tobytes())


def with_photograph(reference_map: ReferenceMap) -> ReferenceMap:
    """The map with one picture, that shows all of it."""
    count = len(reference_map.landmark_ids)
    photographs = MapPhotographs(
        jpegs=(grey(0),),
        cameras=(CAMERA,),
        camera_of_view=np.zeros(1, np.uint16),
        world_T_camera=reference_map.world_T_camera,
        observation_landmark=np.arange(count, dtype=np.uint32),
        observation_view=np.zeros(count, np.uint16),
        normals=np.tile(np.array([0.0, 0.0, -1.0], np.float32), (count, 1)),
    )
    return replace(reference_map, photographs=photographs)


@pytest.fixture(scope="module")
def grown() -> tuple[ReferenceMap, LocalMapper, list[KeptImage]]:
    """A map before it grows, its mapper afterwards, and the images."""
    random = np.random.default_rng(0)
    keyframes = list(walk(walls(200, random), unlike(200, random), 10, random))
    before = with_photograph(elsewhere(random))
    mapper = LocalMapper(make_extendable(before, 1000))
    images = []
    for number, one in enumerate(keyframes):
        mapper.add_keyframe(one)
        images.append(KeptImage(one.camera, one.stamp_ns, one.world_T_camera, grey(number)))
    blind = KeptImage("chest", 5, np.eye(4), grey(99))
    mapper.take_changes()
    return before, mapper, [*images, blind]


def extended(mapper: LocalMapper, images: list[KeptImage]) -> ReferenceMap:
    return mapper.extended_map(images, cameras())


def test_it_is_saved_and_loaded(grown, tmp_path: Path) -> None:
    reference_map, mapper, images = grown
    points, whole = mapper.added_points(), extended(mapper, images)
    whole.save(tmp_path / "map")
    loaded = ReferenceMap.load(tmp_path / "map")
    settled = len(reference_map.landmark_ids)
    assert loaded.grown == len(points) > 60 and loaded.first_grown == settled
    np.testing.assert_array_equal(loaded.points_world[settled:], [point.position for point in points])
    for name in ("landmark_ids", "points_world", "colours"):
        np.testing.assert_array_equal(getattr(loaded, name)[:settled], getattr(reference_map, name))
    assert len(set(loaded.landmark_ids.tolist())) == len(loaded.landmark_ids)
    # An image that shows no landmark is not kept.
    assert len(loaded.image_names) == 1 + len(images) - 1 and "chest/5" not in loaded.image_names
    assert loaded.photographs is not None


def test_every_landmark_is_in_the_images_that_saw_it_and_looks_as_it_did(grown) -> None:
    reference_map, mapper, images = grown
    points, whole = mapper.added_points(), extended(mapper, images)
    photographs, settled = whole.photographs, len(reference_map.landmark_ids)
    assert photographs is not None
    assert np.all(np.diff(photographs.observation_landmark.astype(int)) >= 0)
    np.testing.assert_allclose(np.linalg.norm(photographs.normals, axis=1), 1.0, atol=1e-5)
    for number, point in enumerate(points):
        row = settled + number
        views = photographs.observation_view[photographs.observation_landmark == row]
        seen_in = {f"{s.view.camera}/{s.view.stamp_ns}" for s in point.sightings}
        assert {whole.image_names[view] for view in views} == seen_in
        looks = whole.descriptors[whole.descriptor_landmark == row]
        assert len(looks) == VIEWS
        assert {look.tobytes() for look in looks} <= {s.descriptor.tobytes() for s in point.sightings}
        for view in views:
            camera = photographs.cameras[photographs.camera_of_view[view]]
            seen = whole.world_T_camera[view]
            pixel, valid = camera.project(((point.position - seen[:3, 3]) @ seen[:3, :3])[None])
            assert valid[0] and camera.in_image(pixel)[0]
            towards = seen[:3, 3] - point.position
            assert photographs.normals[row] @ towards > -0.5 * np.linalg.norm(towards)
