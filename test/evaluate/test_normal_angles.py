"""A table of normal angles that a user gives: read back, refused by line, and drawn behind the gait cycles."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.angle_panels import draw_angles
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.gait_cycle import CYCLE_PERCENT, CycleAngle
from bodycam_ros.evaluate.normal_angles import read_normal_angles
from bodycam_ros.evaluate.report import write_report
from bodycam_ros.results.colours import FAINT
from bodycam_ros.results.solved_recording import read_solved

HEADER = "joint,percent,mean,sd\n"


def table(path: Path, *lines: str, header: str = HEADER) -> Path:
    """A table with lines under its header."""
    path.write_text(header + "\n".join(lines))
    return path


def faint_pixels(path: Path) -> int:
    """Number of the pixels that have the colour of the band."""
    pixels = np.asarray(cv2.imread(str(path)), np.uint8)
    return int(np.all(pixels == [int(FAINT[at : at + 2], 16) for at in (5, 3, 1)], axis=2).sum())


def test_a_table_is_read_and_interpolated(tmp_path: Path) -> None:
    knee = 30.0 - 30.0 * np.cos(2.0 * np.pi * CYCLE_PERCENT / 100.0)
    lines = [f"Knee,{p:g},{knee[int(p)]:.4f},5" for p in CYCLE_PERCENT[::2]]
    normal = read_normal_angles(table(tmp_path / "adults.csv", *lines, "", "ankle,10,5,3", "ankle,20,7,4"))
    assert normal.name == "adults.csv" and set(normal.joints) == {"knee", "ankle"}
    np.testing.assert_allclose(normal.joints["knee"].mean, knee, atol=0.1)
    np.testing.assert_allclose(normal.joints["knee"].sd, 5.0)
    ankle = normal.joints["ankle"]
    assert (ankle.mean[15], ankle.sd[15]) == (6.0, 3.5)
    assert np.isnan(ankle.mean[:10]).all() and np.isnan(ankle.mean[21:]).all(), "the table does not have these"


@pytest.mark.parametrize(
    ("lines", "named"),
    [
        (("shoulder,0,1,1",), ("line 2", "shoulder", "hip, knee, ankle")),
        (("knee,0,5,4", "knee,one,5,4"), ("line 3", "one,5,4")),
        (("knee,0,5,-4",), ("line 2", "-4")),
        (("knee,0,5",), ("line 2",)),
        (("knee,0,nan,4",), ("line 2", "nan")),
        (("knee,0,5,4", "knee,101,5,4"), ("line 3", "0 to 100")),
        (("knee,2,5,4", "knee,2,6,4"), ("line 3", "must increase")),
        (("knee,2,5,4",), ("one row", "knee")),
        ((f"knee,{'1' * 140_000},5,4",), ("CSV",)),
        ((), ("no angle",)),
    ],
)
def test_what_cannot_be_is_refused_by_its_line(tmp_path: Path, lines: tuple[str, ...], named: tuple[str, ...]) -> None:
    path = table(tmp_path / "adults.csv", *lines)
    with naming(RecordingError, path, *named):
        read_normal_angles(path)


def test_other_columns_are_named(tmp_path: Path) -> None:
    path = table(tmp_path / "adults.csv", "0,5", header="percent,knee\n")
    with naming(RecordingError, path, "percent,knee", "joint,percent,mean,sd"):
        read_normal_angles(path)


def test_the_band_is_drawn_where_somebody_walks(solved: Path, tmp_path: Path) -> None:
    recording = read_solved(solved)
    cycles = {("knee", "left"): CycleAngle(3, np.full(101, 20.0), np.full(101, 1.0))}
    normal = read_normal_angles(table(tmp_path / "adults.csv", "knee,0,5,10", "knee,100,5,10"))
    for name, given in (("with", normal), ("without", None)):
        assert draw_angles(recording, cycles, tmp_path / f"{name}.png", given)
    with_band, without_band = (faint_pixels(tmp_path / f"{name}.png") for name in ("with", "without"))
    assert with_band > without_band + 1000


def test_a_table_for_somebody_who_does_not_walk_changes_nothing(solved: Path, tmp_path: Path) -> None:
    path = table(tmp_path / "adults.csv", "knee,0,5,10", "knee,100,5,10")
    write_report(evaluate(solved, normal_path=path), tmp_path / "given")
    write_report(evaluate(solved), tmp_path / "plain")
    assert (tmp_path / "given" / "angles.png").read_bytes() == (tmp_path / "plain" / "angles.png").read_bytes()
    assert "adults.csv" not in (tmp_path / "given" / "report.html").read_text()
