"""A structure is scaled by distances that a tape measured, and refused where that cannot be."""

from dataclasses import replace

import numpy as np
import pytest
from small_structure import small_structure

from bodycam_ros.camera import camera_from_info
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.known_distance import KnownDistance, measure_scale
from bodycam_ros.mapping.structure import Structure

INSTANTS = 25
METRES_PER_UNIT = 0.4
APART_M = {"left": np.array([0.15, 0.0, 0.0]), "right": np.array([-0.15, 0.02, 0.0]), "back": np.array([0.0, 0.2, 0.1])}
K = [150.0, 0.0, 160.0, 0.0, 150.0, 120.0, 0.0, 0.0, 1.0]
TRUE = float(np.linalg.norm(APART_M["left"] - APART_M["right"]))


def worn(late_s: float = 0.0) -> tuple[Structure, dict[str, float]]:
    """Three cameras on a waist that turns and sways, in a structure of another scale, and when; one may be late."""
    base = small_structure()
    names, centres, seconds = [], [], {}
    for instant in range(INSTANTS):
        turn = 0.2 * instant
        R = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        sway = np.array([0.1 * np.sin(turn), 0.0, 1.0])
        for camera, place in APART_M.items():
            names.append(f"{instant:02d}_{camera}.jpg")
            centres.append((sway + R @ place) / METRES_PER_UNIT)
            seconds[names[-1]] = 1000.0 + 0.5 * instant + (late_s if camera == "right" else 0.0)
    poses = np.tile(np.eye(4), (len(names), 1, 1))
    poses[:, :3, 3] = np.array(centres)
    structure = replace(
        base,
        names=names,
        cameras=tuple(camera_from_info(name, 320, 240, "equidistant", [0.0] * 4, K) for name in APART_M),
        camera_of_view=np.tile(np.arange(3), INSTANTS),
        world_T_camera=poses,
    )
    return structure, seconds


@pytest.mark.parametrize("late_s", [0.0, 0.015])
def test_the_scale_is_the_tape_s_distance_over_the_map_s(late_s: float) -> None:
    found = measure_scale(*worn(late_s), [KnownDistance("left", "right", TRUE)])
    assert found.scale == pytest.approx(METRES_PER_UNIT, rel=1e-9)
    assert found.sigma == pytest.approx(0.003 / TRUE, rel=1e-6)
    assert found.summary[0]["pairs"] == INSTANTS and found.summary[0]["metres"] == TRUE


def test_frames_at_different_times_do_not_count() -> None:
    with pytest.raises(MapError, match="left and right: both have frames in the map at 0 times"):
        measure_scale(*worn(0.25), [KnownDistance("left", "right", TRUE)])


def test_a_distance_that_changes_is_refused() -> None:
    structure, seconds = worn()
    swings = structure.world_T_camera.copy()
    swings[1::3, 0, 3] += np.linspace(0.0, 0.5, INSTANTS) / METRES_PER_UNIT
    with pytest.raises(MapError, match="left and right: changes by .* same segment"):
        measure_scale(replace(structure, world_T_camera=swings), seconds, [KnownDistance("left", "right", TRUE)])


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
