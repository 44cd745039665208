"""A ride on a bicycle beside the same ride without it, whose foot is turned at the ankle by a known angle."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from held_ride import UNPLACED, write_held
from known_walk import FRAMES, Walk, walking_body, write_solved

from bodycam_ros.cli.main import main
from bodycam_ros.evaluate.equipment import WithAndWithout, with_and_without
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


def test_the_command_shows_both(bags: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_it, without = map(str, bags)
    assert main(["evaluate", with_it, "--compare", without, "-o", str(tmp_path / "report")]) == 0
    written = {path.name for path in (tmp_path / "report").iterdir()}
    assert {"constraints.png", "report.html"} <= written
    assert "with and without equipment" in capsys.readouterr().out
    measures = json.loads((tmp_path / "report" / "summary.json").read_text())["constraints"]["measures"]
    pedal = measures["pedal left [mm]"]
    assert pedal["with"]["max"] < 1e-3
    assert pedal["without"]["max"] == pytest.approx(2e3 * PEDAL_M * np.sin(np.radians(5.0)), rel=0.01)
    assert "with and without equipment" in (tmp_path / "report" / "report.html").read_text()


@pytest.mark.parametrize(
    ("swapped", "told"),
    [(True, "was solved without equipment, so --compare has nothing to show"), (False, "no state")],
)
def test_what_does_not_fit_is_named(
    bags: tuple[Path, Path], ride: Walk, tmp_path: Path, capsys: pytest.CaptureFixture[str], swapped: bool, told: str
) -> None:
    given = list(bags[::-1]) if swapped else [bags[0], tmp_path / "later"]
    if not swapped:
        write_solved(Walk(ride.body, ride.stamps_ns + 10**12, ride.world_T_segment), given[1])
    words = ["evaluate", str(given[0]), "--compare", str(given[1]), "-o", str(tmp_path / "report")]
    assert main(words) == 1
    assert told in re.sub(r"\s+", " ", capsys.readouterr().err)
    assert not (tmp_path / "report").exists()
