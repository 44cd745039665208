"""The photographs of a map: read as they were written, refused where damaged, decoded when they are needed."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.map_photographs import PHOTOGRAPHS_FILE, MapPhotographs, pyramid_size, write_pyramid

LANDMARKS = 5
POSES = exp_se3(np.random.default_rng(0).normal(size=(3, 6)))


def jpeg_of(picture: np.ndarray) -> bytes:
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())


@pytest.fixture
def photographs() -> MapPhotographs:
    random = np.random.default_rng(1)
    normals = random.normal(size=(LANDMARKS, 3))
    k = [100.0, 0, 47.2, 0, 101.0, 31.7, 0, 0, 1]
    return MapPhotographs(
        jpegs=tuple(jpeg_of(cv2.blur(random.integers(0, 256, (64, 96)).astype(np.uint8), (5, 5))) for _ in range(3)),
        cameras=(camera_from_info("photograph", 96, 64, "plumb_bob", [0.1, -0.05, 1e-3, -2e-3, 0.01], k),),
        camera_of_view=np.zeros(3, np.uint16),
        world_T_camera=POSES,
        observation_landmark=np.array([0, 0, 2, 2, 2, 4], np.uint32),
        observation_view=np.array([0, 2, 0, 1, 2, 1], np.uint16),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
    )


def rewrite(folder: Path, **changed: object) -> None:
    """Change arrays of the file; None takes one out."""
    with np.load(folder / PHOTOGRAPHS_FILE) as file:
        arrays = {name: file[name] for name in file.files}
    arrays |= {name: np.asarray(value) for name, value in changed.items()}
    np.savez(
        folder / PHOTOGRAPHS_FILE, **{name: array for name, array in arrays.items() if changed.get(name, 0) is not None}
    )


def test_what_is_saved_is_loaded(tmp_path: Path, photographs: MapPhotographs) -> None:
    photographs.save(tmp_path)
    loaded = MapPhotographs.load(tmp_path, POSES, LANDMARKS)
    assert loaded is not None and loaded.jpegs == photographs.jpegs
    for name in ("camera_of_view", "world_T_camera", "observation_landmark", "observation_view", "normals"):
        was, is_now = getattr(photographs, name), getattr(loaded, name)
        assert was.dtype == is_now.dtype
        np.testing.assert_array_equal(was, is_now)
    for was, is_now in zip(photographs.cameras, loaded.cameras, strict=True):
        np.testing.assert_array_equal(is_now.parameters, was.parameters)
    assert loaded.first_observation.tolist() == [0, 2, 2, 5, 5, 6]
    np.testing.assert_array_equal(loaded.world_T_camera, POSES)


def test_pictures_are_developed_when_they_are_asked_for(photographs: MapPhotographs) -> None:
    damaged = replace(photographs, jpegs=(photographs.jpegs[0], b"no picture", photographs.jpegs[2]))
    damaged.develop(np.array([2, 0, 2]))
    for view in (0, 2):
        picture = cv2.imdecode(np.frombuffer(photographs.jpegs[view], np.uint8), cv2.IMREAD_GRAYSCALE)
        expected = np.zeros(pyramid_size(damaged.levels[0]), np.uint8)
        write_pyramid(picture, damaged.levels[0], expected)
        np.testing.assert_array_equal(damaged.pyramids[view], expected)
    damaged.pyramids[0] = 7
    damaged.develop(np.array([0, 2]))
    assert (damaged.pyramids[0] == 7).all()  # not decoded twice
    damaged.develop(np.zeros(0, np.int64))
    with naming(MapError, "photograph 1"):
        damaged.develop(np.array([0, 1]))
    small = replace(photographs, jpegs=(jpeg_of(np.zeros((32, 48), np.uint8)), *photographs.jpegs[1:]))
    with naming(MapError, "photograph 0"):
        small.develop(np.array([0]))


@pytest.mark.parametrize(
    "changed",
    [
        {"normals": None},
        {"normals": np.zeros((4, 3), np.float32)},
        {"observation_landmark": np.array([0, 0, 2, 2, 2, 5], np.uint32)},
        {"observation_landmark": np.array([0, 2, 0, 2, 2, 4], np.uint32)},
        {"observation_view": np.array([0, 2, 0, 1, 3, 1], np.uint16)},
        {"jpeg_ends": np.array([10, 5, 20])},
        {"jpegs": np.zeros(10, np.uint8)},
        {"size": np.array([96, 0])},
        {"intrinsics": np.array([np.nan, 1.0, 1.0, 1.0])},
        {"distortion_model": np.array("nothing_known")},
        {"distortion": np.full(5, np.inf)},
    ],
    ids=lambda changed: "-".join(changed),
)
def test_what_is_damaged_is_refused(tmp_path: Path, photographs: MapPhotographs, changed: dict[str, object]) -> None:
    photographs.save(tmp_path)
    rewrite(tmp_path, **changed)
    with naming(MapError, tmp_path / "photographs.npz"):
        MapPhotographs.load(tmp_path, POSES, LANDMARKS)
