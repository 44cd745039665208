"""``bodycam study`` on a recording that can be solved and one that cannot."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest
from helpers.altered_sample import write_altered_sample

import bodycam_ros
from bodycam_ros.cli.main import main
from bodycam_ros.study.study_lock import study_lock

pytestmark = pytest.mark.long

ROOT = Path(bodycam_ros.__file__).parent.parent
CUT_OFF = "is cut off: it ends without MCAP's footer"
ALL = ["walk: evaluate", "walk: export csv", "walk: replay"]


@pytest.fixture(scope="module", autouse=True)
def same_code() -> Iterator[None]:
    """The steps run the code under test, whatever is installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        yield


def lay_out(sample: Path, folder: Path) -> Path:
    (folder / "takes").mkdir(parents=True)
    (folder / "hall").symlink_to(sample / "map")
    shutil.copy(sample / "body.yaml", folder / "anna.yaml")
    write_altered_sample(sample, folder / "takes" / "walk")
    path = folder / "knees.yaml"
    path.write_text(
        "places: {hall: {map: hall}}\nsubjects: {anna: {body: anna.yaml}}\nrecordings: [{path: takes/*}]\n"
        "exports: [csv]\n"
    )
    return path


Ran = tuple[Path, "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def ran(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """A study after its first run, and the process."""
    path = lay_out(sample, tmp_path_factory.mktemp("study"))
    broken = path.parent / "takes" / "broken"
    shutil.copytree(path.parent / "takes" / "walk", broken)
    bag = next(broken.glob("*.mcap"))
    os.truncate(bag, 2000)  # before any message
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "study", str(path), "--jobs", "2"]
    return path, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.fixture
def study(ran: Ran) -> Path:
    return ran[0]


def test_a_recording_that_fails_is_named_and_the_others_go_on(ran: Ran) -> None:
    study, done = ran
    assert done.returncode == 1, done.stderr
    out = " ".join(done.stdout.split())
    assert "walk: replay: done in" in out and "broken: replay: FAILED: " in out and CUT_OFF in out
    assert "2 recordings: 1 good, 1 failed; written to" in out
    made = study.parent / "knees"
    with (made / "study.csv").open() as file:
        broken, walk = csv.DictReader(file)
    assert (broken["verdict"], broken["failed_step"]) == ("failed", "broken: replay") and CUT_OFF in broken["reason"]
    assert walk["verdict"] == "good" and float(walk["registered"]) > 0.9 and float(walk["took_s"]) > 1.0
    assert json.loads((made / walk["report"] / "summary.json").read_text())["duration_s"] == pytest.approx(
        float(walk["duration_s"]), rel=1e-5
    )
    page = (made / "study.html").read_text()
    assert '<a href="takes/walk/report/report.html">walk</a>' in page and CUT_OFF in unescape(page)
    assert (made / "exports" / "csv" / "walk.csv").is_file() and not (made / "takes" / "broken" / "out").exists()


def test_the_next_run_tries_only_what_failed(study: Path, capfd: pytest.CaptureFixture[str]) -> None:
    made = study.parent / "knees"
    files = [*made.glob("takes/*/*/*"), *made.glob("exports/*/*")]
    before = {file: file.stat().st_mtime_ns for file in files}
    os.utime(study.parent / "anna.yaml")  # newer, but the same
    assert main(["study", str(study), "--jobs", "1"]) == 1
    out = " ".join(capfd.readouterr().out.split())
    assert "broken: replay: FAILED" in out and "walk: replay: is done" in out and "walk: replay: done in" not in out
    assert {file: file.stat().st_mtime_ns for file in before} == before


def plan(study: Path, capfd: pytest.CaptureFixture[str]) -> list[str]:
    capfd.readouterr()
    assert main(["study", str(study), "--dry-run"]) == 0
    lines = [line.partition(": bodycam ") for line in capfd.readouterr().out.splitlines() if ": bodycam " in line]
    return sorted(name for name, _, _ in lines if name.startswith("walk"))


def test_only_what_changed_is_done_again(
    study: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    body = study.parent / "anna.yaml"
    text = body.read_text()
    body.write_text(f"{text}# corrected\n")
    assert plan(study, capfd) == ALL
    body.write_text(text)
    report = study.parent / "knees" / "takes" / "walk" / "report"
    report.rename(study.parent / "aside")
    assert plan(study, capfd) == ["walk: evaluate"]
    (study.parent / "aside").rename(report)
    monkeypatch.setattr("bodycam_ros.study.step_graph.__version__", "0.0.0")
    assert plan(study, capfd) == ALL


def test_one_run_at_a_time(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with study_lock(study.parent / "knees"):
        assert main(["study", str(study)]) == 1
    assert "another 'bodycam study' or 'bodycam run' is at work" in capsys.readouterr().err


def test_ctrl_c_ends_every_step_and_leaves_nothing_half_written(sample: Path, tmp_path: Path) -> None:
    study = lay_out(sample, tmp_path / "data")
    write_altered_sample(sample, tmp_path / "data" / "takes" / "longer", frames=60)
    made = tmp_path / "data" / "knees"
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "study", str(study), "--jobs", "1"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120.0
        while time.monotonic() < deadline and not list(made.glob("takes/longer/.bodycam.*/out/*.mcap")):
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err and "interrupted" in err
    assert not list((made / "takes" / "longer").rglob("*.mcap"))
    assert not any(str(made) in words for words in _command_lines())


def _command_lines() -> Iterator[str]:
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            yield file.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue


def test_stretches_are_steps_and_give_one_result(sample: Path, tmp_path: Path) -> None:
    path = lay_out(sample, tmp_path / "study")
    path.write_text(path.read_text().replace("path: takes/*", "path: takes/walk, stretches: 1"))
    assert main(["study", str(path), "-o", str(tmp_path / "results")]) == 0
    out = tmp_path / "results/takes/walk/out"
    figures = json.loads((tmp_path / "results/takes/walk/report/summary.json").read_text())
    assert figures["states"] > 5 and figures["verdict"]["level"] == "good"
    assert len(list(out.glob("*.mcap"))) == 3  # what is known at the beginning, the stretch, and what at the end
    assert main(["study", str(path), "-o", str(tmp_path / "results"), "--dry-run"]) == 0
