"""The command with another system's file: what it prints, writes and refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.captured_files import MIXAMO, origins, seconds, write_bvh, write_trc
from helpers.known_walk import FRAME_NS, Walk

from bodycam_ros.cli.main import main
from bodycam_ros.evaluate.sections import Link, Picture, Section, Table, column_table, render_page
from bodycam_ros.results.colours import LEFT

WRITTEN = ["angles.png", "joints.png", "report.html", "summary.json", "summary.png"]


def test_the_command_reports_against_a_bvh(
    solved: Path, walk: Walk, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bvh = write_bvh(tmp_path / "other.bvh", walk, 1e-9 * FRAME_NS)
    assert main(["evaluate", str(solved), "--truth", str(bvh), "-o", str(tmp_path / "report")]) == 0
    assert sorted(path.name for path in (tmp_path / "report").iterdir()) == WRITTEN
    told = capsys.readouterr().out
    assert "against other.bvh" in told and "by the size of the body it is cm" in told
    figures = json.loads((tmp_path / "report" / "summary.json").read_text())["agreement"]
    assert figures["position_cm"]["mean"] < 0.1
    assert set(figures["joints"]) == {"spine", "hip left", "knee left", "ankle left"}
    assert set(figures["points"]) == set(MIXAMO.values())
    shown = (tmp_path / "report" / "report.html").read_text()
    assert "knee left, sagittal" in shown and "same motion as other.bvh: correlation" in shown
    assert shown.count("<img ") == 3 and shown.count('src="data:image/png;base64,iVBOR') == 3
    assert share_of(LEFT, tmp_path / "report" / "joints.png") > 2e-5


def share_of(colour: str, picture: Path) -> float:
    """Share of a picture's pixels that have a colour, about: thin lines are mixed with what is behind them."""
    import cv2

    pixels = cv2.imread(str(picture)).astype(int)
    blue_green_red = [int(colour[at : at + 2], 16) for at in (5, 3, 1)]
    return float((np.abs(pixels - blue_green_red).max(axis=2) < 40).mean())


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        ("--align rigid", "--align needs --truth with what another system captured"),
        ("--truth {truth} --clock found", "--clock needs --truth with what another system captured"),
        ("--truth {folder}/no.trc", "no.trc: does not exist"),
        ("--truth {folder}/other.trc --points {folder}/names.yaml", "other.trc has no 'LKNE'"),
        ("--truth {folder}/other.trc --clock shared", "other.trc: does not overlap"),
    ],
)
def test_what_does_not_fit_is_named_and_nothing_is_written(
    solved: Path,
    truth: Path,
    walk: Walk,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    flags: str,
    told: str,
) -> None:
    write_trc(tmp_path / "other.trc", seconds(walk), origins(walk))
    (tmp_path / "names.yaml").write_text("LKNE: knee_left")
    words = flags.format(folder=tmp_path, truth=truth).split()
    assert main(["evaluate", str(solved), "-o", str(tmp_path / "report"), *words]) == 1
    assert told in re.sub(r"\s+", " ", capsys.readouterr().err)
    assert not (tmp_path / "report").exists()


def test_a_page_shows_text_as_text() -> None:
    table = column_table("", "name", [("x", "x", ".2f")], {"a|b": {"x": -0.001}, "": {"x": None}}).table
    assert table is not None
    table = Table(table.columns, [table.rows[0], (Link("c", "a b/r.html"), table.rows[1][1])])
    section = Section("Part", ("1 < 2 & *",), ("<script>",), table, (Picture(b"not much", "what"),))
    shown = render_page("A <b>", ("line",), (section,))
    assert "<h1>A &lt;b&gt;</h1>" in shown and "1 &lt; 2 &amp; *" in shown and "<li>&lt;script&gt;</li>" in shown
    assert ">0.00</td>" in shown and '<a href="a%20b/r.html">c</a>' in shown and "base64,bm90IG11Y2g=" in shown
