"""One table of missing values for TRC, C3D and CSV: the same gaps are the same, however a program writes them."""

from pathlib import Path

import ezc3d
import numpy as np
import pytest

from bodycam_ros.formats.read_captured import read_captured, read_joint_points

SEEN = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
GAPS = {
    "origin": ["0", "0.000", "-0"],
    "nan": ["NaN", "nan", "NaN"],
    "empty": ["", "", ""],
    "one axis": ["1", "", "2"],
    "large": ["9999999.000000", "9999999.000000", "9999999.000000"],
    "nines": ["-9999", "-9999", "-9999"],
    "of C": ["-1.#IND", "-1.#IND", "-1.#IND"],
}


def trc(rows: list[list[str]]) -> str:
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta",
        "DataRate\tNumFrames\tNumMarkers\tUnits",
        "10\t3\t1\tm",
        "Frame#\tTime\tKNEE",
    ]
    lines += ["\t\tX1\tY1\tZ1", *("\t".join([str(k), f"{k / 10}", *cells]) for k, cells in enumerate(rows, 1))]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("suffix", ["trc", "csv"])
def test_a_gap_is_missing(tmp_path: Path, gap: str, suffix: str) -> None:
    rows = [[str(value) for value in row] for row in SEEN.tolist()]
    rows[1] = GAPS[gap]
    path = tmp_path / f"a.{suffix}"
    path.write_text(trc(rows) if suffix == "trc" else "\n".join(["KNEE_x,KNEE_y,KNEE_z", *map(",".join, rows)]))
    points = read_joint_points(path)
    assert points is not None
    assert np.isfinite(points["KNEE"]).all(axis=1).tolist() == [True, False, True]


@pytest.mark.parametrize("gap", [[0.0, 0.0, 0.0], [9999999.0] * 3, [-9999.0] * 3, [np.nan] * 3])
def test_a_gap_of_a_c3d_is_missing(tmp_path: Path, gap: list[float]) -> None:
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"], point["LABELS"]["value"] = [10.0], ["mm"], ["KNEE"]
    rows = SEEN.copy()
    rows[1] = gap
    file["data"]["points"] = np.concatenate([rows.T[:, None], np.ones((1, 1, 3))])
    file.write(str(tmp_path / "a.c3d"))
    points = read_captured(tmp_path / "a.c3d").points["KNEE"]
    assert np.isfinite(points).all(axis=1).tolist() == [True, False, True]


def test_a_point_on_an_axis_is_seen(tmp_path: Path) -> None:
    """One or two coordinates may be zero."""
    (tmp_path / "a.trc").write_text(trc([["0", "0", "1"], ["0", "1", "0"], ["9999", "0", "0"]]))
    assert np.isfinite(read_captured(tmp_path / "a.trc").points["KNEE"]).all()


@pytest.mark.parametrize("counted", ["of the header", "of TRIAL"])
def test_a_c3d_longer_than_its_header_can_count_is_read_whole(tmp_path: Path, counted: str) -> None:
    count = 70_000
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"], point["LABELS"]["value"] = [100.0], ["m"], ["RKNE", "LKNE"]
    if counted == "of TRIAL":
        file.add_parameter("TRIAL", "ACTUAL_START_FIELD", [1, 0])
        file.add_parameter("TRIAL", "ACTUAL_END_FIELD", [count % 65536, count // 65536])
    points = np.ones((4, 2, count))
    points[0] = np.arange(count) / 100.0
    points[:3, 1, 69_000] = np.nan
    file["data"]["points"] = points
    file.write(str(tmp_path / "long.c3d"))
    captured = read_captured(tmp_path / "long.c3d")
    assert len(captured.stamps_ns) == count
    np.testing.assert_allclose(captured.points["RKNE"][:, 0], points[0, 0], rtol=1e-6)
    assert np.flatnonzero(np.isnan(captured.points["LKNE"][:, 0])).tolist() == [69_000]
