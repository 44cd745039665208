"""A structure is scaled by what a tape said, and refused where that cannot be."""

from pathlib import Path

import numpy as np
import pytest
from small_structure import small_structure

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.known_distance import KnownDistance, measure_scale
from bodycam_ros.mapping.photographs import FrameOrigin, Photographs
from bodycam_ros.mapping.structure import Structure

INSTANTS = 25
METRES_PER_UNIT = 0.4
APART_M = {"left": np.array([0.15, 0.0, 0.0]), "right": np.array([-0.15, 0.02, 0.0]), "back": np.array([0.0, 0.2, 0.1])}
TRUE = float(np.linalg.norm(APART_M["left"] - APART_M["right"]))


def worn(noise_m: float = 0.0, late_s: float = 0.0) -> tuple[Structure, Photographs]:
    """Three cameras on a waist that turns and sways, in a structure of another scale; one clock may lag."""
    random = np.random.default_rng(3)
    names, centres, origins = [], [], {}
    for instant in range(INSTANTS):
        turn = 0.2 * instant
        R = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        sway = np.array([0.1 * np.sin(turn), 0.0, 1.0])
        for camera, place in APART_M.items():
            names.append(f"{camera}_{instant}.jpg")
            centres.append((sway + R @ place + noise_m * random.normal(size=3)) / METRES_PER_UNIT)
            origins[names[-1]] = FrameOrigin(camera, 1000.0 + 0.5 * instant + (late_s if camera == "right" else 0.0))
    order = np.argsort(names)
    poses = np.tile(np.eye(4), (len(names), 1, 1))
    poses[:, :3, 3] = np.array(centres)[order]
    structure = small_structure()
    names = [names[row] for row in order]
    return Structure(
        names,
        structure.cameras[:1],
        np.zeros(len(names), np.int64),
        poses,
        structure.points_world,
        structure.colours,
        structure.observation_views,
        structure.observation_points,
        structure.observation_pixels,
        structure.observation_features,
    ), Photographs(Path(), "", (), {}, None, origins)


def test_the_scale_is_what_the_tape_said_over_what_the_map_says() -> None:
    found = measure_scale(*worn(), [KnownDistance("left", "right", TRUE)])
    assert found.scale == pytest.approx(METRES_PER_UNIT, rel=1e-9)
    assert found.sigma == pytest.approx(0.003 / TRUE, rel=1e-6)
    assert found.summary[0]["pairs"] == INSTANTS and found.summary[0]["metres"] == TRUE


def test_distances_that_contradict_each_other_are_refused() -> None:
    wrong = KnownDistance("left", "back", 2.0 * float(np.linalg.norm(APART_M["left"] - APART_M["back"])))
    with pytest.raises(MapError, match="left.*right.*left.*back"):
        measure_scale(*worn(), [KnownDistance("left", "right", TRUE), wrong])


@pytest.mark.parametrize(
    ("second", "metres"), [("left", 0.3), ("right", 0.0), ("right", -1.0), ("right", float("nan"))]
)
def test_what_is_no_distance_is_refused(second: str, metres: float) -> None:
    with pytest.raises(MapError, match="left"):
        KnownDistance("left", second, metres)
