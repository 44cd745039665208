"""The photographs as a map keeps them show the same places, and landmarks lie on the surfaces that there are."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.board_picture import wide_camera
from helpers.recorded_progress import Unshown
from helpers.small_structure import small_structure
from numpy.typing import NDArray

from bodycam_ros.mapping.small_photographs import small_photographs, surface_normals
from bodycam_ros.mapping.structure import Structure


def structure_of(points: NDArray[np.float64], centres: NDArray[np.float64]) -> Structure:
    """Points (L, 3) that cameras at (K, 3) all see."""
    poses = np.tile(np.eye(4), (len(centres), 1, 1))
    poses[:, :3, 3] = centres
    count = len(points) * len(centres)
    return Structure(
        names=[f"{k}.png" for k in range(len(centres))],
        cameras=(wide_camera(),),
        camera_of_view=np.zeros(len(centres), np.int64),
        world_T_camera=poses,
        points_world=points,
        colours=np.zeros((len(points), 3), np.uint8),
        observation_views=np.repeat(np.arange(len(centres)), len(points)),
        observation_points=np.tile(np.arange(len(points)), len(centres)),
        observation_pixels=np.zeros((count, 2)),
        observation_features=np.zeros(count, np.int64),
    )


@pytest.fixture
def folder(tmp_path: Path) -> tuple[Path, Structure, list[NDArray[np.uint8]]]:
    structure = small_structure()
    random = np.random.default_rng(4)
    pictures = [
        cv2.blur(random.integers(0, 256, (camera.height, camera.width, 3)).astype(np.uint8), (21, 21))
        for camera in (structure.cameras[row] for row in structure.camera_of_view)
    ]
    names = ["a.png", "b.png", "c.png"]
    for name, picture in zip(names, pictures, strict=True):
        cv2.imwrite(str(tmp_path / name), picture)
    return tmp_path, replace(structure, names=names), pictures


def test_pictures_are_kept_small_and_grey_in_the_order_of_the_poses(folder, monkeypatch) -> None:
    monkeypatch.setattr("bodycam_ros.mapping.small_photographs._WIDTH_PX", 160)
    monkeypatch.setattr("bodycam_ros.mapping.small_photographs._JPEG_QUALITY", 95)
    path, structure, pictures = folder
    kept = small_photographs(path, structure, 2, Unshown())
    assert [(camera.width, camera.height) for camera in kept.cameras] == [(160, 120), (160, 120)]
    assert kept.camera_of_view.tolist() == [0, 0, 1] and kept.camera_of_view.dtype == np.uint16
    assert kept.cameras[1].distortion_model == "equidistant" and kept.cameras[1].fx == 75.0
    for jpeg, picture in zip(kept.jpegs, pictures, strict=True):
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        wanted = cv2.resize(grey, (160, 120), interpolation=cv2.INTER_AREA)
        shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
        assert shown.shape == (120, 160)
        assert np.abs(shown.astype(float) - wanted).max() < 8
    # In the order of the landmarks, each with those that see it.
    for row in (0, 3, 39):
        first, end = kept.first_observation[row : row + 2]
        seers = structure.observation_views[structure.observation_points == row]
        assert kept.observation_view[first:end].tolist() == sorted(seers.tolist())
    np.testing.assert_allclose(np.linalg.norm(kept.normals, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize("noise_m", [0.0, 0.003])
def test_walls_of_a_room_have_their_normals(noise_m: float) -> None:
    random = np.random.default_rng(5)
    walls, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            points = random.uniform(-1.7, 1.7, (400, 3))
            points[:, axis] = 2.0 * side + noise_m * random.normal(size=400)
            walls.append(points)
            normals.append(np.tile(-side * np.eye(3)[axis], (400, 1)))
    structure = structure_of(np.concatenate(walls), random.uniform(-0.5, 0.5, (4, 3)))
    found = surface_normals(structure)
    angles = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", found, np.concatenate(normals)), -1, 1)))
    # Near the edges neighbours are of two walls.
    assert np.median(angles) < (1e-5 if noise_m == 0.0 else 3.0)
    assert (angles < 10.0).mean() > 0.95
