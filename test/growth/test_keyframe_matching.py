"""Which features of two keyframes are said to show one point; the kernel itself is tested with photographs."""

import numpy as np
from grown_room import keyframe, unlike, walked, walls

from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.keyframe_matching import match_keyframes
from bodycam_ros.growth.worn_keyframe import WornKeyframe

SETTINGS = GrowthSettings()


def everything(one: WornKeyframe) -> np.ndarray:
    return np.arange(len(one.bearings))


def pair(
    seed: int, noise_px: float = 0.3, repeated: float = 0.0
) -> tuple[WornKeyframe, WornKeyframe, np.ndarray, np.ndarray]:
    """Two keyframes, and the point that each feature shows; some points may look like others."""
    random = np.random.default_rng(seed)
    points, looks = walls(400, random), unlike(400, random)
    alike = np.flatnonzero(random.random(400) < repeated)
    looks[alike] = looks[random.integers(0, 400, len(alike))]
    shown = []
    for number in (3 * seed, 3 * seed + 2):
        one = keyframe("chest", number, walked(0, number), points, looks, random, noise_px)
        shown.append(one)
    return shown[0], shown[1], points, looks


def test_matches_are_right_where_many_things_look_alike() -> None:
    """Geometry tells apart what descriptors do not: half of the points share their look with another."""
    first, second, points, _ = pair(1, repeated=0.5)
    here, there = match_keyframes(first, second, everything(first), everything(second), SETTINGS)
    directions = []
    for one, rows in ((first, here), (second, there)):
        towards = points[None] - one.world_T_camera[:3, 3]
        towards /= np.linalg.norm(towards, axis=2, keepdims=True)
        rays = one.bearings[rows] @ one.world_T_camera[:3, :3].T
        directions.append(np.einsum("npi,ni->np", np.broadcast_to(towards, (len(rows), *points.shape)), rays).argmax(1))
    assert len(here) > 40
    assert (directions[0] == directions[1]).mean() > 0.95
