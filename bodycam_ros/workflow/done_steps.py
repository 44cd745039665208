"""Which steps are done for the present state of what they read: a note of each beside what it wrote."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

from bodycam_ros import __version__
from bodycam_ros.errors import OutputError
from bodycam_ros.whole_file import write_whole
from bodycam_ros.workflow.step import Step

_READ = 4_000_000
"""Bytes up to which a file is known by its content; larger ones are images, known by size and time of change."""


class DoneSteps:
    """Notes of the steps that were done.

    Args:
        folder: where the notes are kept.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def exit_code(self, step: Step, anew: bool) -> int | None:
        """What the step ended with, if it is done and need not be done again; else None.

        Args:
            step: in question.
            anew: what it reads is being made anew, so it must be.

        Raises:
            OutputError: it must be done again, but somebody has changed by hand what it wrote.
        """
        note = self._note(step)
        if note is None or not step.output.exists():
            return None
        if note.get("state") == state_of(step) and not anew:
            return int(note.get("exit_code", 0))
        if self.is_changed(step):
            raise OutputError(
                f"{step.output}: was changed after 'bodycam run' wrote it, and what it was made of has changed, too; "
                "move it away to have it made anew, or take it as it is (a body as body.yaml, a map as map/ in the "
                "folder of recordings)"
            )
        return None

    def is_changed(self, step: Step) -> bool:
        """Whether somebody has changed by hand what the step wrote, which is still there."""
        note = self._note(step)
        return note is not None and step.output.exists() and note.get("output") != fingerprint(step.output)

    def note(self, step: Step, state: str, exit_code: int) -> None:
        """Remember that a step is done, for the state of its inputs in which it began."""
        self._folder.mkdir(parents=True, exist_ok=True)
        said = {"words": step.words, "state": state, "output": fingerprint(step.output), "exit_code": exit_code}
        write_whole(self._file(step), json.dumps(said, indent=1) + "\n")

    def _note(self, step: Step) -> dict[str, Any] | None:
        try:
            note = json.loads(self._file(step).read_text())
        except (OSError, ValueError):
            return None
        return note if isinstance(note, dict) else None

    def _file(self, step: Step) -> Path:
        return self._folder / f"{quote(step.name, safe=' ')}.json"


def state_of(step: Step) -> str:
    """What a step is made of: this version, its command and what it reads, wherever that is."""
    places = {str(path) for path in (*step.inputs, step.output)}
    flags = [word for word in step.words if word not in places]
    parts = [__version__, *flags, *map(fingerprint, step.inputs)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def fingerprint(path: Path) -> str:
    """Of a file, or of all files in a folder, links followed: names, and contents or sizes and times."""
    digest = hashlib.sha256()
    files = sorted(Path(root, name) for root, _, names in os.walk(path, followlinks=True) for name in names)
    for file in files if path.is_dir() else [path]:
        try:
            status = file.stat()
            known: object = (status.st_size, status.st_mtime_ns)
            if status.st_size <= _READ:
                known = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            known = error.errno
        name = file.relative_to(path).as_posix() if path.is_dir() else ""
        digest.update(f"{name}\0{known}\0".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()
