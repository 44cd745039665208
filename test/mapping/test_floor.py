"""The floor is found beneath the person, whatever the structure's scale and turn; a ceiling or a table is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_structure import small_structure

from bodycam_ros.geometry import exp_so3
from bodycam_ros.mapping.floor import find_floor
from bodycam_ros.mapping.photographs import FrameOrigin, Photographs
from bodycam_ros.mapping.structure import Structure

HEIGHTS = {"foot": 0.1, "shin": 0.35, "waist": 1.0, "head": 1.7, "hand": 0.8}
TURN, SHIFT = exp_so3(np.array([0.8, -1.4, 0.5])), np.array([3.0, -1.0, 2.0])


def structure_of(points: NDArray[np.float64], scale: float = 1.0) -> tuple[Structure, Photographs]:
    """Body cameras of a person who moves about the origin, among points [m]; in another frame and scale."""
    random = np.random.default_rng(2)
    names, centres, origins = [], [], {}
    for camera, height in HEIGHTS.items():
        for number in range(20):
            reach = 0.6 if camera == "hand" else 0.15
            names.append(f"{camera}_{number}.jpg")
            centres.append(random.uniform(-reach, reach, 3) * [1.0, 1.0, 0.5 * (height > 0.5)] + [0.0, 0.0, height])
            origins[names[-1]] = FrameOrigin(camera, float(number))
    poses = np.tile(np.eye(4), (len(names), 1, 1))
    poses[:, :3, 3] = np.array(centres)
    structure = replace(
        small_structure(),
        names=names,
        camera_of_view=np.zeros(len(names), np.int64),
        world_T_camera=poses,
        points_world=points,
    )
    return structure.transformed(scale, TURN, SHIFT), Photographs(Path(), "", (), {}, None, origins)


def room(floor: int, ceiling: int, table: int = 0) -> NDArray[np.float64]:
    """Landmarks of a room 6 m wide and 3.5 m high, with a table of a metre."""
    random = np.random.default_rng(4)
    parts = [
        random.uniform([-3, -3, 0], [3, 3, 0], (floor, 3)),
        random.uniform([-3, -3, 3.5], [3, 3, 3.5], (ceiling, 3)),
        random.uniform([-3, -3, 0], [-3, 3, 3.5], (600, 3)),
        random.uniform([-3, 3, 0], [3, 3, 3.5], (600, 3)),
        random.uniform([1, 1, 0.8], [2, 2, 0.8], (table, 3)),
        random.uniform([-3, -3, 0], [3, 3, 3.5], (400, 3)),
    ]
    points = np.concatenate(parts)
    return np.asarray(points + 0.003 * random.normal(size=points.shape))


@pytest.mark.parametrize("scale", [1.0, 0.03, 40.0])
def test_the_floor_is_level_and_at_zero(scale: float) -> None:
    structure, photographs = structure_of(room(500, 1500, 800), scale)
    floor = find_floor(structure, photographs)
    assert floor is not None
    up = TURN.T @ floor.map_R_world.T @ [0.0, 0.0, 1.0]
    assert np.degrees(np.arccos(up[2])) < 0.1
    assert np.degrees(np.arccos(up[2])) < 5.0 * floor.tilt_sigma_deg + 0.02
    np.testing.assert_allclose(floor.map_R_world @ floor.map_R_world.T, np.eye(3), atol=1e-12)
    placed = structure.transformed(1.0 / scale, floor.map_R_world, -floor.map_R_world @ floor.origin / scale)
    heads = [pose[2, 3] for name, pose in zip(placed.names, placed.world_T_camera, strict=True) if "head" in name]
    assert np.median(heads) == pytest.approx(1.7, abs=0.1)
    assert abs(np.median(placed.points_world[:500, 2])) < 0.002
    assert np.linalg.norm(placed.world_T_camera[:, :2, 3].mean(axis=0)) < 0.2
    assert 480 < floor.landmarks < 560


def test_without_landmarks_on_the_floor_there_is_none_but_a_ceiling_is_not_taken_for_one() -> None:
    structure, photographs = structure_of(room(0, 0))
    assert find_floor(structure, photographs) is None
