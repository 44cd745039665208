"""Only one run of a study at a time, and what a killed run left behind.

Snakemake locks its folder by files, which stay when it is killed. The lock here is of the system, and passes on to the
Snakemake that is started: it is free exactly when neither of the two lives any more.
"""

import fcntl
import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.errors import StudyError
from bodycam_ros.shown import printable
from bodycam_ros.whole_file import failure_named

LOCK = ".bodycam-study"
_SNAKEMAKE_LOCKS = Path(".snakemake", "locks")


@dataclass(frozen=True)
class StudyLock:
    """The lock of a folder, held.

    Attributes:
        descriptor: to be passed on to Snakemake.
        is_left: a run before us was killed on this machine, and Snakemake's own lock, which stayed, may be removed.
    """

    descriptor: int
    is_left: bool


@contextmanager
def study_lock(folder: Path) -> Iterator[StudyLock]:
    """Hold the lock of a study's folder.

    Raises:
        StudyError: another run holds it, or a Snakemake that somebody else started.
        OutputError: the folder cannot be written to.
    """
    with failure_named(folder / LOCK):
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        said = _said(descriptor)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise StudyError(f"{folder}: another 'bodycam study' is at work in it{_who(said)}; wait for it") from error
        is_locked = any((folder / _SNAKEMAKE_LOCKS).glob("*"))
        if is_locked and said.get("host") != platform.node():
            elsewhere = f"a run{_who(said)} that did not end in order, or by " if said else ""
            raise StudyError(
                f"{folder}: is locked by {elsewhere}a snakemake that 'bodycam study' did not start. If none is at work "
                f"any more: snakemake --unlock --directory {folder}"
            )
        _write(descriptor, {"host": platform.node(), "pid": os.getpid()})
        yield StudyLock(descriptor, is_locked)
        if not any((folder / _SNAKEMAKE_LOCKS).glob("*")):
            _write(descriptor, {})
    finally:
        os.close(descriptor)


def _who(said: dict[str, object]) -> str:
    return printable(f" (process {said.get('pid')} on {said.get('host')})") if said else ""


def _said(descriptor: int) -> dict[str, object]:
    try:
        said = json.loads(os.pread(descriptor, 4096, 0) or b"{}")
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


def _write(descriptor: int, said: dict[str, object]) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, json.dumps(said).encode(), 0)
