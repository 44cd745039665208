"""The floor is found beneath the person, whatever the structure's scale and turn; a ceiling or a table is none."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.small_structure import small_structure
from numpy.typing import NDArray

from bodycam_ros.geometry import exp_so3, rotation_to_z
from bodycam_ros.mapping.floor import stand_on_floor
from bodycam_ros.mapping.structure import Structure

HEIGHTS = {"foot": 0.1, "shin": 0.35, "waist": 1.0, "head": 1.7, "hand": 0.8}
TURN, SHIFT = exp_so3(np.array([0.8, -1.4, 0.5])), np.array([3.0, -1.0, 2.0])


def structure_of(points: NDArray[np.float64], scale: float = 1.0) -> Structure:
    """Body cameras of a person who moves about the origin, among points [m]; in another frame and scale."""
    random = np.random.default_rng(2)
    centres = []
    for camera, height in HEIGHTS.items():
        for _ in range(20):
            reach = 0.6 if camera == "hand" else 0.15
            centres.append(random.uniform(-reach, reach, 3) * [1.0, 1.0, 0.5 * (height > 0.5)] + [0.0, 0.0, height])
    poses = np.tile(np.eye(4), (len(centres), 1, 1))
    poses[:, :3, 3] = np.array(centres)
    structure = replace(
        small_structure(),
        cameras=small_structure().cameras[:1] * len(HEIGHTS),
        camera_of_view=np.repeat(np.arange(len(HEIGHTS)), 20),
        world_T_camera=poses,
        points_world=points,
    )
    return structure.transformed(scale, TURN, SHIFT)


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
@pytest.mark.parametrize("up", [None, TURN @ [0.0, 0.0, 1.0]])
def test_the_floor_is_level_and_at_zero(scale: float, up: NDArray[np.float64] | None) -> None:
    """By its own normal, and by a vertical that sensors measure."""
    placed, floor = stand_on_floor(structure_of(room(500, 1500, 800), scale), up)
    assert floor is not None
    assert np.degrees(np.arccos(min(1.0, (TURN.T @ floor.up)[2]))) < (0.1 if up is None else 1e-4)
    assert 480 < floor.landmarks < 560
    placed = placed.transformed(1.0 / scale, np.eye(3), np.zeros(3))
    centres = placed.world_T_camera[:, :3, 3]
    assert np.median(centres[placed.camera_of_view == list(HEIGHTS).index("head"), 2]) == pytest.approx(1.7, abs=0.1)
    assert abs(np.median(placed.points_world[:500, 2])) < 0.002
    assert np.linalg.norm(centres[:, :2].mean(axis=0)) < 0.01


def test_without_landmarks_on_the_floor_there_is_none_but_a_ceiling_is_not_taken_for_one() -> None:
    structure = structure_of(room(0, 0))
    assert stand_on_floor(structure, None) == (structure, None)
    placed, floor = stand_on_floor(structure, TURN @ [0.0, 0.0, 1.0])
    assert floor is None
    assert placed.points_world[:600, 2].max() - placed.points_world[:600, 2].min() == pytest.approx(3.5, abs=0.05)
    assert abs(placed.world_T_camera[:, 2, 3].min()) < 0.05


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-0.6, 0.0, 0.8)])
def test_rotation_to_z(up: tuple[float, float, float]) -> None:
    """The x axis is turned as far as it must be."""
    R = rotation_to_z(np.array(up))
    assert R @ up == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[0] == pytest.approx([0.0, 1.0, 0.0] if up[0] == 1.0 else [up[2], 0.0, -up[0]], abs=1e-12)
