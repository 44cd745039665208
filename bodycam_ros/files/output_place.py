"""Where a command may write: never over what it reads, and over what is there only if a command made it.

Commands ask before the work, so that an hour of it is not lost to a folder that cannot be written.
"""

import os
import re
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path

from bodycam_ros.errors import OutputError

_LOOKED_AT = 65_536  # [bytes] of a file, by which its kind is known


def check_output(output: Path, inputs: Iterable[Path | None]) -> None:
    """Refuse an output that is an input, contains one or lies within one, or that cannot be written.

    Symbolic links are followed and inodes compared: what is read may have several names.

    Args:
        output: file or folder to be.
        inputs: files and folders that the command reads; None for those that were not given.

    Raises:
        OutputError: so it is; the message names both.
    """
    output = Path(os.path.realpath(output))
    for given in inputs:
        if given is not None and (relation := _relation(output, Path(os.path.realpath(given)))):
            raise OutputError(
                f"{output}: {relation} what this command reads ({given}), which it must not touch; choose another place"
            )
    if output.name != os.fsencode(output.name).decode("utf-8", "replace"):
        raise OutputError(f"{output}: a name that is not UTF-8 cannot stand in what is written; choose another")
    _check_writable(output)


def check_file(path: Path, force: bool, mark: bytes, what: str) -> None:
    """Refuse to write a file where something is, unless ``force`` is given and it is an earlier file of the same kind.

    Args:
        path: the file to be.
        force: replace what a command of ours wrote.
        mark: what every such file has near its beginning.
        what: it is, for messages: "body file".

    Raises:
        OutputError: it is not replaced.
    """
    try:
        mode = path.stat().st_mode if path.exists() else None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    if mode is None:
        return
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or device"
        raise OutputError(f"{path}: is {kind}; give the name of a file for the {what}")
    _ask_for_force(path, force)
    with path.open("rb") as file:
        start = file.read(_LOOKED_AT)
    if start.strip() and mark not in start:
        raise OutputError(f"{path}: is no {what}, so --force does not replace it; choose another name")


def check_folder(path: Path, force: bool, main_file: str, parts: re.Pattern[str], what: str) -> None:
    """Refuse to replace the folder that is at ``path``, unless ``force`` is given and all that it holds is ours.

    Args:
        path: of the folder that is there.
        force: replace what a command of ours wrote.
        main_file: name of the file without which it is none of ours; an empty folder may be replaced, too.
        parts: fits the path, within the folder, of every file that is ours.
        what: it is, for messages: "map".

    Raises:
        OutputError: it is not replaced; the message names what is in it.
    """
    if not path.is_dir():
        raise OutputError(f"{path}: is there, and is no folder; choose another name")
    _ask_for_force(path, force)
    files = [Path(folder, name).relative_to(path) for folder, _, names in os.walk(path) for name in names]
    foreign = [file for file in files if not parts.fullmatch(file.as_posix())]
    if foreign:
        problem = f"holds {min(foreign)}, which is no part of a {what}"
    elif files and not (path / main_file).is_file():
        problem = f"is no {what} (it has no {main_file})"
    else:
        return
    raise OutputError(f"{path}: {problem}, so --force does not replace it; choose another name")


def _ask_for_force(path: Path, force: bool) -> None:
    if not force:
        raise OutputError(f"{path}: exists already; choose another name, or replace it with --force")


def _check_writable(output: Path) -> None:
    """Try it in the nearest folder that is there; what is tried has no name, so nothing can be left behind."""
    try:
        output.exists()  # a name can be too long
        folder = next(parent for parent in output.parents if parent.exists())
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{output}: cannot be written: {error.strerror or error}") from error


def _relation(output: Path, place: Path) -> str | None:
    """How an output stands to an input, both resolved; None if they have nothing to do with each other."""
    if _is_same(output, place):
        return "is"
    if any(_is_same(parent, place) for parent in output.parents):
        return "lies within"
    return "contains" if any(_is_same(output, parent) for parent in place.parents) else None


def _is_same(first: Path, second: Path) -> bool:
    """Whether two paths are one file or folder, which may have several names."""
    both_there = os.path.exists(first) and os.path.exists(second)
    return first == second or (both_there and os.path.samefile(first, second))
