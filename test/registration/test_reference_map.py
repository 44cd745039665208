"""A map in a folder: whole or refused; and what it must know before a body is made or solved in it."""

import dataclasses

import numpy as np
import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.errors import MapError, OutputError
from bodycam_ros.registration.reference_map import ReferenceMap


@pytest.fixture
def small_map():
    rng = np.random.default_rng(5)
    return ReferenceMap(
        landmark_ids=np.arange(10, dtype=np.uint32),
        points_world=rng.normal(size=(10, 3)),
        colours=rng.integers(0, 256, (10, 3)).astype(np.uint8),
        descriptor_landmark=np.repeat(np.arange(10, dtype=np.uint32), 2),
        descriptors=rng.integers(0, 256, (20, 128)).astype(np.uint8),
        descriptor_view=np.tile(np.float32([0, 0, 1]), (20, 1)),
        descriptor_size=np.full(20, 0.01, np.float32),
        world_T_camera=np.tile(np.eye(4), (3, 1, 1)),
        image_names=("a.jpg", "b.jpg", "ä.png"),
        metric=True,
        gravity_aligned=False,
        summary={"registered": 3},
    )


def test_what_is_saved_is_loaded(tmp_path, small_map):
    small_map.save(tmp_path / "map", also=lambda folder: (folder / "more.txt").write_text("more"))
    loaded = ReferenceMap.load(tmp_path / "map")
    for field in dataclasses.fields(ReferenceMap):
        was, is_now = getattr(small_map, field.name), getattr(loaded, field.name)
        if isinstance(was, np.ndarray):
            assert np.array_equal(was, is_now) and was.dtype == is_now.dtype, field.name
        elif field.name == "words":
            assert is_now.fit(len(small_map.descriptors))
        elif field.name != "summary":
            assert was == is_now, field.name
    assert loaded.summary["registered"] == 3
    assert (tmp_path / "map" / "more.txt").read_text() == "more"
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


def test_a_map_is_replaced_only_by_force(tmp_path, small_map):
    small_map.save(tmp_path / "map")
    other = dataclasses.replace(small_map, points_world=small_map.points_world + 1.0)
    with naming(OutputError, tmp_path / "map", "--force"):
        other.save(tmp_path / "map")
    assert np.array_equal(ReferenceMap.load(tmp_path / "map").points_world, small_map.points_world)
    other.save(tmp_path / "map", force=True)
    assert np.array_equal(ReferenceMap.load(tmp_path / "map").points_world, other.points_world)
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


def test_force_replaces_nothing_but_maps(tmp_path, small_map):
    (tmp_path / "photographs").mkdir()
    (tmp_path / "photographs" / "dear.jpg").write_bytes(b"...")
    with naming(OutputError, "dear.jpg"):
        small_map.save(tmp_path / "photographs", force=True)
    assert (tmp_path / "photographs" / "dear.jpg").exists()


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError("disk full")])
def test_a_failure_half_way_leaves_the_old_map_and_nothing_else(tmp_path, small_map, error):
    small_map.save(tmp_path / "map")

    def fail(folder):
        raise error

    with pytest.raises((KeyboardInterrupt, OutputError)):
        dataclasses.replace(small_map, metric=False).save(tmp_path / "map", force=True, also=fail)
    assert ReferenceMap.load(tmp_path / "map").metric
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"\x00" * 500])
def test_a_damaged_file_is_an_error(tmp_path, small_map, content):
    small_map.save(tmp_path / "map")
    (tmp_path / "map" / "landmarks.npz").write_bytes(content)
    with naming(MapError, tmp_path / "map" / "landmarks.npz"):
        ReferenceMap.load(tmp_path / "map")


def test_what_is_no_map_is_named(tmp_path, small_map):
    (tmp_path / "photographs").mkdir()
    (tmp_path / "body.yaml").write_text("{}")
    for name, named in (("nothing", ()), ("photographs", ("map.yaml",)), ("body.yaml", ("file",))):
        with naming(MapError, tmp_path / name, *named, "bodycam map"):
            ReferenceMap.load(tmp_path / name)
    small_map.save(tmp_path / "map")
    (tmp_path / "map/map.yaml").write_text("{gravity_aligned: true}")
    with naming(MapError, "map.yaml"):
        ReferenceMap.load(tmp_path / "map")


def test_another_version_is_an_error(tmp_path, small_map):
    small_map.save(tmp_path / "map")
    summary = yaml.safe_load((tmp_path / "map" / "map.yaml").read_text())
    (tmp_path / "map" / "map.yaml").write_text(yaml.safe_dump(summary | {"version": 99}))
    with naming(MapError, "version 99"):
        ReferenceMap.load(tmp_path / "map")


@pytest.mark.parametrize(
    "change",
    [
        {"points_world": np.zeros((4, 3))},
        {"descriptor_landmark": np.full(20, 10, np.uint32)},
        {"descriptor_landmark": np.arange(20, dtype=np.uint32)[::-1] // 2},
    ],
)
def test_arrays_that_do_not_fit_are_an_error(tmp_path, small_map, change):
    dataclasses.replace(small_map, **change).save(tmp_path / "map")
    with naming(MapError, tmp_path / "map"):
        ReferenceMap.load(tmp_path / "map")


def test_landmarks_are_found_by_their_ids_in_any_order(small_map):
    named = dataclasses.replace(small_map, landmark_ids=np.array([70, 3, 9, 2**32 - 2, 5, 1, 40, 8, 6, 11], np.uint32))
    rows, known = named.rows_of(np.array([3, 4, 2**32 - 2, 1, 2**32 - 1, 70, 3, 0], np.uint32))
    assert known.tolist() == [True, False, True, True, False, True, True, False]
    assert rows[known].tolist() == [1, 3, 5, 0, 1]
    rows, known = named.rows_of(np.zeros(0, np.uint32))
    assert len(rows) == len(known) == 0


def test_a_map_that_could_not_be_read_is_not_written(tmp_path, small_map):
    broken = dataclasses.replace(small_map, descriptor_view=small_map.descriptor_view * np.float32(np.nan))
    with naming(MapError, tmp_path / "map", "descriptor_view"):
        broken.save(tmp_path / "map")
    assert not (tmp_path / "map").exists()
