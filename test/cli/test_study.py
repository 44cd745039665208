"""``bodycam study`` with the real Snakemake, on a recording that can be solved and one that cannot."""

import csv
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from altered_sample import write_altered_sample

import bodycam_ros
from bodycam_ros.cli.main import main
from bodycam_ros.study.corrected_bodies import CorrectedBodies
from bodycam_ros.study.job_resources import JobResources
from bodycam_ros.study.study import study_steps
from bodycam_ros.study.study_file import read_study
from bodycam_ros.study.workflow_folder import LOCK, WorkflowFolder, folder_of

pytestmark = pytest.mark.long

ROOT = Path(bodycam_ros.__file__).parent.parent
CUT_OFF = "is cut off: it ends without MCAP's footer"


@pytest.fixture(scope="module", autouse=True)
def same_code() -> Iterator[None]:
    """What the jobs run is what is tested, whatever is installed."""
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
    """A study that was run once, and what that said."""
    path = lay_out(sample, tmp_path_factory.mktemp("study"))
    broken = path.parent / "takes" / "broken"
    shutil.copytree(path.parent / "takes" / "walk", broken)
    bag = next(broken.glob("*.mcap"))
    os.truncate(bag, bag.stat().st_size // 2)
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "study", str(path), "--cores", "1"]
    return path, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.fixture
def study(ran: Ran) -> Path:
    return ran[0]


def changed_at(folder: Path) -> dict[str, int]:
    files = [*folder.glob("takes/*/*/*"), *folder.glob("exports/*/*"), *folder.glob("study.*")]
    return {str(file.relative_to(folder)): file.stat().st_mtime_ns for file in files}


def test_a_recording_that_fails_is_named_and_the_others_go_on(ran: Ran) -> None:
    study, done = ran
    assert done.returncode == 1, done.stderr
    out, err = (" ".join(text.split()) for text in (done.stdout, done.stderr))
    assert "walk: replay: done in" in err and "broken: replay: FAILED: ../takes/broken" in err
    assert "2 recordings: 1 good, 1 failed; written to" in out and CUT_OFF in out
    made = study.parent / "knees"
    with (made / "study.csv").open() as file:
        broken, walk = csv.DictReader(file)
    assert (broken["verdict"], broken["failed_step"]) == ("failed", "broken: replay") and CUT_OFF in broken["reason"]
    assert walk["verdict"] == "good" and float(walk["registered"]) > 0.9 and float(walk["took_s"]) > 1.0
    assert json.loads((made / walk["report"] / "summary.json").read_text())["duration_s"] == pytest.approx(
        float(walk["duration_s"]), rel=1e-5
    )
    page = (made / "study.html").read_text()
    assert '<a href="takes/walk/report/report.html">walk</a>' in page and CUT_OFF in page.replace("&#x27;", "'")
    assert (made / "exports" / "csv" / "walk.csv").is_file() and not (made / "takes" / "broken" / "out").exists()


def test_the_run_after_a_killed_one_unlocks_and_tries_only_what_failed(
    study: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    made = study.parent / "knees"
    before = changed_at(made)
    assert before
    lock = made / ".snakemake" / "locks" / "0.output.lock"
    lock.write_text("takes/walk/out\n")
    (made / LOCK).write_text(json.dumps({"host": platform.node(), "pid": 1}))
    os.utime(study.parent / "anna.yaml")  # newer, but the same
    assert main(["study", str(study), "--cores", "1"]) == 1
    err = " ".join(capfd.readouterr().err.split())
    assert "unlocked, because a run before was killed" in err and not lock.exists()
    assert "broken: replay: FAILED" in err and "walk:" not in err
    assert changed_at(made) == before


def plan(study: Path, capfd: pytest.CaptureFixture[str]) -> list[str]:
    capfd.readouterr()
    assert main(["study", str(study), "--dry-run"]) == 0
    return sorted(line for line in capfd.readouterr().out.splitlines() if line.startswith("walk"))


ALL = ["walk: evaluate", "walk: export csv", "walk: replay"]


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
    monkeypatch.setattr("bodycam_ros.study.workflow_folder.__version__", "0.0.0")
    assert plan(study, capfd) == ALL


def test_ctrl_c_ends_every_job_and_leaves_nothing_half_written(sample: Path, tmp_path: Path) -> None:
    study = lay_out(sample, tmp_path / "data")
    log = tmp_path / "data" / "knees" / "logs" / "replay" / "walk.log"
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "study", str(study), "--cores", "1"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120.0
        while time.monotonic() < deadline and not log.exists():
            time.sleep(0.02)
        time.sleep(0.5)
        os.kill(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err and "interrupted" in err
    made = tmp_path / "data" / "knees"
    assert not list((made / "takes").rglob("*.mcap")) and not list((made / ".snakemake" / "locks").iterdir())
    assert not any(str(made) in words for words in _command_lines())


def _command_lines() -> Iterator[str]:
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            yield file.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue


def test_a_corrected_body_is_not_replaced_for_want_of_its_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it was made of is the same, but Snakemake has more reasons to make it anew."""
    for bag in ("rom", "walk"):
        (tmp_path / bag).mkdir()
        (tmp_path / bag / "metadata.yaml").touch()
    (tmp_path / "hall").mkdir()
    (tmp_path / "rig.yaml").touch()
    path = tmp_path / "knees.yaml"
    path.write_text(
        "places: {hall: {map: hall}}\nsubjects: {anna: {rig: rig.yaml, range_of_motion: rom}}\n"
        "recordings: [{path: walk}]\n"
    )
    study = read_study(path)
    folder = WorkflowFolder.at(folder_of(path), study)
    steps = study_steps(study, folder.path)
    folder.write(steps, JobResources.on_a_cluster({}))
    (body,) = steps.of_subjects["anna"]
    body.output.parent.mkdir(parents=True)
    body.output.write_text("made")
    CorrectedBodies(folder.path).note(body)
    body.output.write_text("corrected")
    assert main(["study", str(path), "--cores", "1"]) == 1
    assert "body.yaml: was changed by hand" in " ".join(capsys.readouterr().err.split())
    assert body.output.read_text() == "corrected"


def test_without_snakemake_it_says_what_to_install(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["study", str(study)]) == 1
    assert "snakemake, which is not installed: pip install 'bodycam_ros[study]'" in capsys.readouterr().err


def test_the_page_of_what_is_done_needs_no_snakemake(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (study.parent / "knees" / "study.md").unlink()
    assert main(["study", str(study), "--report-only"]) == 1
    assert "broken" in (study.parent / "knees" / "study.md").read_text()
