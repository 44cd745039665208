"""A map is scaled by distances that a tape measured, and refused where that cannot be."""

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.inertial.map_alignment import RegisteredPoses
from bodycam_ros.mapping.known_distance import KnownDistance, measure_scale

INSTANTS = 25
METRES_PER_UNIT = 0.4
APART_M = {"left": np.array([0.15, 0.0, 0.0]), "right": np.array([-0.15, 0.02, 0.0]), "back": np.array([0.0, 0.2, 0.1])}
TRUE = float(np.linalg.norm(APART_M["left"] - APART_M["right"]))


def worn(late_s: float = 0.0) -> dict[str, RegisteredPoses]:
    """Three cameras on a waist that turns and sways, in a map of another scale; one may be late."""
    turns = 0.2 * np.arange(INSTANTS)
    R = exp_so3(turns[:, None] * [0.0, 0.0, 1.0])
    sway = np.column_stack([0.1 * np.sin(turns), np.zeros(INSTANTS), np.ones(INSTANTS)])
    stamps_ns = 1_000_000_000_000 + 500_000_000 * np.arange(INSTANTS)
    return {
        camera: (
            stamps_ns + (round(1e9 * late_s) if camera == "right" else 0),
            rigid(R, (sway + R @ place) / METRES_PER_UNIT),
        )
        for camera, place in APART_M.items()
    }


@pytest.mark.parametrize("late_s", [0.0, 0.015])
def test_the_scale_is_the_tape_s_distance_over_the_map_s(late_s: float) -> None:
    found = measure_scale(worn(late_s), [KnownDistance("left", "right", TRUE)])
    assert found.scale == pytest.approx(METRES_PER_UNIT, rel=1e-9)
    assert found.sigma == pytest.approx(0.003 / TRUE, rel=1e-6)
    assert found.summary[0]["pairs"] == INSTANTS and found.summary[0]["metres"] == TRUE


def test_images_at_different_times_do_not_count() -> None:
    with naming(MapError, "left and right", "0 times"):
        measure_scale(worn(0.25), [KnownDistance("left", "right", TRUE)])


def test_a_distance_that_changes_is_refused() -> None:
    poses = worn()
    poses["right"][1][:, 0, 3] += np.linspace(0.0, 0.5, INSTANTS) / METRES_PER_UNIT
    with naming(MapError, "left and right", "segment"):
        measure_scale(poses, [KnownDistance("left", "right", TRUE)])


def test_distances_that_contradict_each_other_are_refused() -> None:
    wrong = KnownDistance("left", "back", 2.0 * float(np.linalg.norm(APART_M["left"] - APART_M["back"])))
    with naming(MapError, "left to right", "left to back"):
        measure_scale(worn(), [KnownDistance("left", "right", TRUE), wrong])


@pytest.mark.parametrize(
    ("second", "metres"), [("left", 0.3), ("right", 0.0), ("right", -1.0), ("right", float("nan"))]
)
def test_what_is_no_distance_is_refused(second: str, metres: float) -> None:
    with naming(MapError, f"left and {second}"):
        KnownDistance("left", second, metres)
