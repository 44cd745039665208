"""A TRC's columns belong to its names by their order, and a header that contradicts its rows is named."""

import logging
from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP
from bodycam_ros.formats.read_captured import read_captured

ROWS = ["1\t0.00\t1\t2\t3\t4\t5\t6", "2\t0.01\t1\t2\t3\t4\t5\t6"]
RKNE, LKNE = Y_UP_TO_Z_UP @ [1.0, 2.0, 3.0], Y_UP_TO_Z_UP @ [4.0, 5.0, 6.0]


def write(
    path: Path, names: str = "Frame#\tTime\tRKNE\t\t\tLKNE", rows: list[str] | None = None, values: str = "100\t2\t2\tm"
) -> Path:
    head = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumFrames\tNumMarkers\tUnits", values, names, "\t\tX1\tY1"]
    path.write_text("\n".join([*head, *(rows or ROWS)]) + "\n")
    return path


@pytest.mark.parametrize(
    "names",
    [
        "Frame#\tTime\tRKNE\t\t\tLKNE\t\t",
        "Frame#\tTime\t\tRKNE\t\tLKNE",
        "Frame#\tTime\t\tRKNE\t\t\tLKNE\t\t\t",
        "Frame#\tTime\tRKNE\tLKNE",
        "Frame#\tTime\tRKNE\t\tLKNE\t",
        "Frame# Time RKNE LKNE",
    ],
)
def test_the_kth_name_has_the_kth_three_columns(tmp_path: Path, names: str) -> None:
    points = read_captured(write(tmp_path / "a.trc", names)).points
    np.testing.assert_array_equal(points["RKNE"], [RKNE, RKNE])
    np.testing.assert_array_equal(points["LKNE"], [LKNE, LKNE])


@pytest.mark.parametrize(
    "rows",
    [
        [row.replace("\t", "  ") for row in ROWS],
        [row + "\t" for row in ROWS],
        [row.replace("\t", "\t\t", 2).replace("\t\t", "\t", 1) for row in ROWS],
    ],
    ids=["spaces", "a tab at the end", "a tab more after the time"],
)
def test_rows_may_have_other_white_space(tmp_path: Path, rows: list[str]) -> None:
    points = read_captured(write(tmp_path / "a.trc", rows=rows)).points
    np.testing.assert_array_equal(points["RKNE"], [RKNE, RKNE])
    np.testing.assert_array_equal(points["LKNE"], [LKNE, LKNE])


def test_the_line_of_axes_may_lack(tmp_path: Path) -> None:
    path = write(tmp_path / "a.trc")
    path.write_text(path.read_text().replace("\t\tX1\tY1\n", ""))
    assert len(read_captured(path).stamps_ns) == 2


def test_a_marker_without_a_name_keeps_its_columns(tmp_path: Path) -> None:
    points = read_captured(write(tmp_path / "a.trc", "Frame#\tTime\t\t\t\tLKNE\t\t")).points
    np.testing.assert_array_equal(points["LKNE"], [LKNE, LKNE])


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("Frame#\tTime\t\t\tLKNE\t\t", "line 4 names 1 markers, which have 5 columns, but rows have 8"),
        ("Frame#\tTime\tA\t\t\tB\t\t\tC\t\t", "line 4 names 3 markers, but NumMarkers is 2, and rows have 8 columns"),
    ],
)
def test_names_that_contradict_the_rows_are_refused(tmp_path: Path, names: str, told: str) -> None:
    with pytest.raises(RecordingError) as caught:
        read_captured(write(tmp_path / "a.trc", names))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ("100\t3\t2\tm", "header says 3 frames, it has 2"),
        ("50\t2\t2\tm", "header says 50 frames a second, its times 100"),
        ("100\t2\t2\tmm", "by its unit (mm) its markers are 0.0052 m apart"),
        ("100\t2\t5\tm", "header says 5 markers, it names 2"),
        ("100\t2\t2\tm", ""),
    ],
)
def test_a_header_that_contradicts_the_rows_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, values: str, told: str
) -> None:
    caplog.set_level(logging.WARNING)
    read_captured(write(tmp_path / "a.trc", values=values))
    assert told in caplog.text if told else not caplog.text
