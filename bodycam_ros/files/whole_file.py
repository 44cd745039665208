"""Files and folders that are there whole or not at all.

Everything is written under a temporary name beside its place, brought to the disk, and then renamed. An error or Ctrl-C
at any time leaves what was there before, and no temporary files.
"""

import errno
import fcntl
import os
import re
import shutil
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from bodycam_ros.errors import OutputError

SCRATCH_PREFIX = ".bodycam."
"""How the names of the temporary folders begin; only a process that is killed leaves one, until the next clears it."""

_SCRATCH_NAME = re.compile(re.escape(SCRATCH_PREFIX) + "[0-9a-f]{32}")
_MARK = b"made by bodycam for the time that it writes something beside; removed once no process holds it\n"
_YOUNG_S = 10.0
_TRIES = 20


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; an earlier one is replaced.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path) as unfinished:
        unfinished.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the path to write a file to; it takes its place, and that of an earlier one, when the block ends.

    Folders above it are made.

    Raises:
        OutputError: it cannot be written, in the block or after it, or what is there is no file.
    """
    final = _final(path)
    with failure_named(path):
        final.parent.mkdir(parents=True, exist_ok=True)
        with _scratch(final.parent, named=path) as scratch:
            if final.exists() and not final.is_file():
                raise FileExistsError(errno.EEXIST, "is there, and is no file")
            yield (unfinished := scratch / final.name)
            _bring_to_disk(unfinished)
            unfinished.replace(final)
            _bring_to_disk(final.parent)


@contextmanager
def whole_files(folder: Path, inside: bool = False) -> Iterator[Path]:
    """Give an empty folder to write files to, which are moved into ``folder`` together when the block ends.

    Files of the same names are replaced; other files in the folder stay. It is made if it is not there.

    Args:
        folder: for the files.
        inside: write them in the folder at first instead of beside it: what is above a folder of the user's may be
            another disk, or not the user's.

    Raises:
        OutputError: they cannot be written, in the block or after it; none is moved before all are on the disk.
    """
    final = _final(folder)
    with failure_named(folder):
        (final if inside else final.parent).mkdir(parents=True, exist_ok=True)
        with _scratch(final if inside else final.parent, named=folder) as scratch:
            (unfinished := scratch / "files").mkdir()
            yield unfinished
            _bring_tree_to_disk(unfinished)
            final.mkdir(exist_ok=True)
            for file in sorted(unfinished.iterdir()):
                file.replace(final / file.name)
            _bring_to_disk(final)


@contextmanager
def whole_folder(path: Path, check_replaceable: Callable[[Path], None]) -> Iterator[Path]:
    """Give the path to make a folder at; it takes its place when the block ends. Folders above it are made.

    What is there already stays whole until the new folder has its place, and is put back if that fails.

    Args:
        path: the folder to be.
        check_replaceable: called with ``path`` if something is there, before the block and after it; raises what the
            user should know if that must not be replaced.

    Raises:
        OutputError: the place cannot be written to; the message has the place of the old folder if it could not be put
            back. Errors of the block are passed on as they are; ``failure_named`` makes these of it.
    """
    final = _final(path)
    with failure_named(path):
        if final.exists():
            check_replaceable(path)
        final.parent.mkdir(parents=True, exist_ok=True)
    with _scratch(final.parent, named=path) as scratch:
        yield (unfinished := scratch / final.name)
        with failure_named(path):
            _bring_tree_to_disk(unfinished)
            if final.exists():
                check_replaceable(path)
            _exchange_with_others(final, unfinished)
            _bring_to_disk(final.parent)


@contextmanager
def failure_named(path: Path) -> Iterator[None]:
    """Raise an OSError of the block as OutputError: ``path`` cannot be written."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _exchange_with_others(path: Path, new: Path) -> None:
    """``_exchange``; again where another process, which replaces the same folder, came between: the last one stays."""
    for _ in range(_TRIES):
        try:
            return _exchange(path, new)
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST) or not new.exists():
                raise
    return _exchange(path, new)


def _exchange(path: Path, new: Path) -> None:
    """Move a folder to ``path`` and remove what was there; an interruption at any point leaves one of them there."""
    old = path.parent / f".bodycam-replaced.{uuid.uuid4().hex}"  # no scratch folder, which another process would clear
    is_replaced = False  # as it is seen once: another process may be moving what is there a moment later
    try:
        if path.exists():
            path.rename(old)
        new.rename(path)
        is_replaced = True
    except BaseException as error:
        is_replaced = path.exists()
        if old.exists() and not is_replaced:
            try:
                old.rename(path)
            except OSError:
                raise OSError(errno.EIO, f"{error}; what was there is whole, in {old}") from error
        raise
    finally:
        if is_replaced:
            shutil.rmtree(old, ignore_errors=True)


@contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """A folder in another, that no other program sees, removed afterwards; so are those of killed processes.

    In it is a file of its own name, by which it is known to be ours.

    Raises:
        OSError: it cannot be made.
    """
    scratch = parent / f"{SCRATCH_PREFIX}{uuid.uuid4().hex}"
    try:
        scratch.mkdir(0o700)
        with _held(scratch):
            (scratch / scratch.name).write_bytes(_MARK)
            _clear_stale(parent)
            yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


@contextmanager
def _scratch(parent: Path, named: Path) -> Iterator[Path]:
    """A ``scratch_folder``. Raises OutputError about ``named`` if it cannot be made."""
    with ExitStack() as stack:
        with failure_named(named):
            scratch = stack.enter_context(scratch_folder(parent))
        yield scratch


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold a lock on a folder, which the system lets go of when this process ends, however it ends."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some file systems have no locks; there, nothing is taken for stale
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def _clear_stale(parent: Path) -> None:
    """Remove scratch folders that no living process holds, and nothing of a user's that is named like one."""
    for folder in parent.glob(f"{SCRATCH_PREFIX}*"):
        if not _SCRATCH_NAME.fullmatch(folder.name):
            continue
        with suppress(OSError):
            # One that is new may not be held yet.
            if time.time() - folder.stat().st_mtime < _YOUNG_S:
                continue
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                mark = folder / folder.name
                if mark.is_file() and mark.stat().st_size == len(_MARK) and mark.read_bytes() == _MARK:
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)


def _final(path: Path) -> Path:
    """Where a path leads: what is beside it is on the same disk, and it has a name even if it is ``.``."""
    return Path(os.path.realpath(path))


def _bring_tree_to_disk(folder: Path) -> None:
    for place, _, files in os.walk(folder):
        for file in files:
            _bring_to_disk(Path(place, file))
        _bring_to_disk(Path(place))


def _bring_to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        if path.is_dir():
            with suppress(OSError):  # some file systems cannot do this for a folder
                os.fsync(descriptor)
        else:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
