"""bodycam bench: flags that do not go together are refused before the work."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.cli.bench_solver import solver_table
from bodycam_ros.cli.main import main
from bodycam_ros.evaluate.solver_comparison import MeasuredRun
from bodycam_ros.evaluate.solver_runs import SolverRun, Way

INPUTS = ["bench", "bag", "--map", "map", "--body", "body.yaml"]


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--truth", "walk"], "--truth needs --solver"),
        (["--picture", "new.png", "--truth", "walk"], "--truth needs --solver"),
        (["--picture", "new.png"], "--picture needs --solver"),
        (["--solver", "--picture", "new.png"], "--picture needs --truth"),
        (["--solver", "--force"], "--force needs --picture"),
        (["--solver", "--minutes", "3"], "--minutes is not for --solver"),
    ],
)
def test_flags_that_would_be_passed_over_are_refused(
    flags: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*INPUTS, *flags])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("picture", "force", "complaint"),
    [
        ("map/new.png", [], "lies within what this command reads"),
        ("old.png", [], "old.png: exists already; choose another name, or replace it with --force"),
        ("notes.txt", ["--force"], "notes.txt: is no picture (PNG), so --force does not replace it"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    picture: str,
    force: list[str],
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("map").mkdir()
    Path("old.png").write_bytes(b"\x89PNG of before")
    Path("notes.txt").write_text("mine")
    # The recording is not there: what is said of the picture comes first.
    assert main([*INPUTS, "--solver", "--truth", "walk", "--picture", picture, *force]) == 1
    assert complaint in " ".join(capsys.readouterr().err.split())
    assert Path("old.png").read_bytes() == b"\x89PNG of before" and Path("notes.txt").read_text() == "mine"


def test_without_truth_the_table_has_no_columns_of_errors() -> None:
    run = SolverRun(Way.WINDOW, np.arange(2), np.tile(np.eye(4), (2, 1, 1, 1)), np.array([2.0, 4.0]), 7.0, 30.0)
    table = solver_table({Way.WINDOW: MeasuredRun(run, None)}, "as recorded")
    assert [column.header for column in table.columns] == ["way", "CPU [ms]", "p95 [ms]", "late [ms]", "memory [MB]"]
    assert [list(column.cells) for column in table.columns] == [["iSAM2 + 4"], ["3.0"], ["3.9"], ["30"], ["7"]]
