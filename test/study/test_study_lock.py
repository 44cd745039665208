"""One run of a study at a time; what a killed one leaves is taken away only if nobody holds it."""

import json
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from bodycam_ros.errors import StudyError
from bodycam_ros.study.study_lock import LOCK, study_lock


def locked_by_snakemake(folder: Path) -> Path:
    lock = folder / ".snakemake" / "locks" / "0.output.lock"
    lock.parent.mkdir(parents=True)
    lock.touch()
    return lock


def test_a_second_run_is_told_who_is_at_work(tmp_path: Path) -> None:
    with study_lock(tmp_path), pytest.raises(StudyError, match=rf"another .* is at work .*on {platform.node()}"):
        with study_lock(tmp_path):
            raise AssertionError("both have it")
    with study_lock(tmp_path) as lock:
        assert not lock.is_left


def test_a_process_that_it_was_passed_on_to_keeps_it(tmp_path: Path) -> None:
    with study_lock(tmp_path) as lock:
        child = subprocess.Popen(
            [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=(lock.descriptor,), text=True
        )
    with pytest.raises(StudyError, match="is at work in it"), study_lock(tmp_path):
        raise AssertionError("the child holds it")
    child.communicate("\n")
    with study_lock(tmp_path):
        assert child.returncode == 0


def test_what_a_killed_run_left_is_said(tmp_path: Path) -> None:
    with study_lock(tmp_path):
        snakemake = locked_by_snakemake(tmp_path)
    with study_lock(tmp_path) as lock:
        assert lock.is_left
        snakemake.unlink()
    with study_lock(tmp_path) as lock:
        assert not lock.is_left


@pytest.mark.parametrize("left", [{}, {"host": "another", "pid": 1}])
def test_what_may_be_at_work_elsewhere_is_left_alone(tmp_path: Path, left: dict[str, object]) -> None:
    snakemake = locked_by_snakemake(tmp_path)
    (tmp_path / LOCK).write_text(json.dumps(left))
    with pytest.raises(StudyError, match=r"is locked .* snakemake --unlock --directory"), study_lock(tmp_path):
        raise AssertionError("it was given")
    assert snakemake.exists()
