"""Who may use a folder of results."""

import errno
import fcntl
import os
from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.errors import OutputError, StudyError
from bodycam_ros.study.study_lock import study_lock


def test_one_at_a_time(tmp_path: Path) -> None:
    with study_lock(tmp_path / "a"), naming(StudyError, tmp_path / "a"), study_lock(tmp_path / "a"):
        pass
    with study_lock(tmp_path / "a"):
        pass


def test_a_file_system_without_locks_locks_nobody_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int, operation: int) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with study_lock(tmp_path / "a") as lock:
        assert lock.is_file()


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    with naming(OutputError, tmp_path / "a"), study_lock(tmp_path / "a"):
        pass
