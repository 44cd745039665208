"""A ride on a bicycle beside the same ride without it, whose foot is turned at the ankle by a known angle."""

from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAMES, Walk, walking_body, write_solved
from helpers.naming import naming
from helpers.ride_with_open_joints import UNPLACED, write_held

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.with_and_without import WithAndWithout, draw_constraints, with_and_without
from bodycam_ros.results.solved_recording import read_solved

TURNED_DEG = 10.0 * np.sin(np.linspace(0.0, np.pi, FRAMES))
PEDAL_M = float(np.hypot(0.12, 0.08))
"""From the ankle to the pedal's line."""


@pytest.fixture(scope="module")
def bags(ride: Walk, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """With the bicycle, and without."""
    folder = tmp_path_factory.mktemp("rides")
    body = walking_body()
    rows = [ride.body.segment_index[segment] for segment in body.segments]
    without = Walk(body, ride.stamps_ns, ride.world_T_segment[:, rows]).bent("ankle_left", TURNED_DEG)
    return write_held(ride, folder / "with"), write_solved(without, folder / "without")


@pytest.fixture(scope="module")
def both(bags: tuple[Path, Path]) -> WithAndWithout:
    return with_and_without(read_solved(bags[0]), read_solved(bags[1]), None, None)


def test_distances_are_from_where_the_pedal_is(both: WithAndWithout) -> None:
    (point,) = both.points
    assert (point.name, point.segment) == ("pedal_left", "foot_left")
    placed = slice(len(UNPLACED), FRAMES)
    assert len(both.stamps_ns) == FRAMES - len(UNPLACED)
    assert point.off_with.max() < 1e-6
    expected = 2.0 * PEDAL_M * np.sin(np.radians(TURNED_DEG[placed]) / 2.0)
    np.testing.assert_allclose(point.off_without, expected, atol=1e-6)


def test_both_are_measured_and_drawn(both: WithAndWithout, tmp_path: Path) -> None:
    pedal = both.figures()["pedal left [mm]"]
    assert pedal.with_it.max < 1e-3
    assert pedal.without.max == pytest.approx(2e3 * PEDAL_M * np.sin(np.radians(5.0)), rel=0.01)
    draw_constraints(both, tmp_path / "feet.png")
    assert (tmp_path / "feet.png").stat().st_size > 10_000


def test_what_does_not_fit_is_named(bags: tuple[Path, Path], ride: Walk, tmp_path: Path) -> None:
    write_solved(Walk(ride.body, ride.stamps_ns + 10**12, ride.world_T_segment), tmp_path / "later")
    with_it, without, later = map(read_solved, (*bags, tmp_path / "later"))
    with naming(RecordingError, bags[1], "equipment"):
        with_and_without(without, with_it, None, None)
    with naming(RecordingError, tmp_path / "later"):
        with_and_without(with_it, later, None, None)
