"""``bodycam run`` on a folder that is made of the repository's own sample."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.altered_sample import write_altered_sample

import bodycam_ros
from bodycam_ros.cli.main import main
from bodycam_ros.errors import StudyError
from bodycam_ros.study.study_lock import study_lock

ROOT = Path(bodycam_ros.__file__).parent.parent


@pytest.fixture
def folder(sample: Path, tmp_path: Path) -> Path:
    path = tmp_path / "monday"
    (path / "takes").mkdir(parents=True)
    (path / "map").symlink_to(sample / "map")
    (path / "body.yaml").write_text((sample / "body.yaml").read_text())
    write_altered_sample(sample, path / "takes" / "walk")
    return path


def left_in(take: Path) -> list[Path]:
    """Files in a take's results; Snakemake makes folders before a step, and may remove those that are empty."""
    return [path for path in take.rglob("*") if not path.is_dir()]


def said(capfd: pytest.CaptureFixture[str]) -> str:
    return " ".join(capfd.readouterr().out.split())


@pytest.mark.long
def test_a_take_is_solved_once_and_again_when_its_body_changes(capfd: pytest.CaptureFixture[str], folder: Path) -> None:
    assert main(["run", str(folder), "--jobs", "1"]) == 0
    first = said(capfd)
    assert "walk: evaluate: done in" in first
    picture = folder / "solved" / "takes" / "walk" / "report" / "summary.png"
    assert picture.is_file() and f"walk: {picture}" in first
    assert "walk: replay: bodycam replay" in first

    assert main(["run", str(folder), "--jobs", "2"]) == 0
    assert said(capfd).startswith("walk: replay: is done walk: evaluate: is done")

    body = folder / "body.yaml"
    body.write_text(body.read_text() + "# corrected\n")
    assert main(["run", str(folder), "--dry-run"]) == 0
    again = said(capfd)
    assert "walk: replay: bodycam replay" in again and "walk: evaluate: bodycam evaluate" in again


def test_a_step_that_fails_costs_only_what_needs_it(capfd: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "body.yaml").write_text("nonsense: true\n")
    assert main(["run", str(folder), "--jobs", "1"]) == 1
    captured = capfd.readouterr()
    assert "bodycam: error:" in captured.err and "body.yaml" in captured.err
    assert "walk: evaluate: FAILED: not run, because step 'walk: replay' failed" in captured.out
    assert not (folder / "solved" / "takes" / "walk" / "out").exists()


def test_what_is_missing_is_named(capfd: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "body.yaml").unlink()
    assert main(["run", str(folder)]) == 1
    assert f"missing in {folder}: rom/ with a range of motion (or body.yaml)" in said(capfd)


def test_ctrl_c_ends_it_and_leaves_nothing_half_written(folder: Path) -> None:
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "run", str(folder), "--jobs", "1"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60.0
        take = folder / "solved" / "takes" / "walk"
        while time.monotonic() < deadline and not take.exists():
            time.sleep(0.01)
        os.kill(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err and "interrupted" in err
    assert left_in(take) == []


def test_its_step_ends_soon_after_it_was_killed(folder: Path, sample: Path) -> None:
    write_altered_sample(sample, folder / "takes" / "longer", frames=60)
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "run", str(folder), "--jobs", "1"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        take = folder / "solved" / "takes" / "longer"
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline and not list(take.glob(".bodycam.*/out/*.mcap")):
            time.sleep(0.01)
        process.kill()
    ended = time.monotonic()
    time.sleep(0.3)  # no other run can begin sooner; the lock is not fair
    while time.monotonic() < ended + 30.0:
        try:
            with study_lock(folder / "solved"):
                break
        except StudyError:
            time.sleep(0.1)
    else:
        pytest.fail("another run is locked out: a step of the one that was killed goes on")
    assert left_in(take) == []
