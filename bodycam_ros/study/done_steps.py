"""Which steps are done for the present state of their inputs: a note of each step, with fingerprints."""

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from bodycam_ros import __version__
from bodycam_ros.errors import StudyError
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.study.study import Step

_MAX_HASHED = 4_000_000  # [bytes] larger files hold images; size and time of change identify them


class DoneSteps:
    """Notes of the steps that were done.

    Args:
        folder: where the notes are kept.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def steps_to_run(self, steps: Iterable[Step]) -> list[Step]:
        """Steps whose command, inputs or software changed or output is missing, and those that read their outputs.

        Args:
            steps: each after the steps whose outputs it reads.

        Raises:
            StudyError: a step must run again, but its output was changed by hand since.
        """
        needed: list[Step] = []
        outputs: set[Path] = set()
        for step in steps:
            note = self._read(step)
            exists = bool(note) and step.output.exists()
            if exists and note.get("state") == state_of(step) and not outputs & set(step.inputs):
                continue
            if exists and note.get("output") != fingerprint(step.output):
                raise StudyError(
                    f"{step.output}: was changed by hand, and its inputs have changed since. To keep it, move it and "
                    "name it as an input (body.yaml or map/ of a folder; body or map in a study file); to have it "
                    "made again, remove it"
                )
            needed.append(step)
            outputs.add(step.output)
        return needed

    def write(self, step: Step, state: str, exit_code: int, seconds: float) -> None:
        """Note that a step is done, for the state that its inputs had when it started."""
        self._folder.mkdir(parents=True, exist_ok=True)
        note = {
            "words": step.words,
            "state": state,
            "output": fingerprint(step.output),
            "exit_code": exit_code,
            "seconds": round(seconds, 1),
        }
        write_whole(self._file(step), json.dumps(note, indent=1) + "\n")

    def exit_code(self, step: Step) -> int:
        """Exit code of a step that is done: 0, or 3 for a result that should not be used."""
        return int(self._read(step).get("exit_code", 0))

    def seconds(self, step: Step) -> float | None:
        """How long a step took [s]; None if that is unknown."""
        return self._read(step).get("seconds")

    def _read(self, step: Step) -> dict[str, Any]:
        try:
            note = json.loads(self._file(step).read_text())
        except (OSError, ValueError):
            return {}
        return note if isinstance(note, dict) else {}

    def _file(self, step: Step) -> Path:
        return self._folder / f"{quote(step.name, safe=' ')}.json"


def state_of(step: Step) -> str:
    """Hash of the software's version, the command without paths, and the contents of all inputs."""
    flags = [part for part in step.parts if isinstance(part, str)]
    parts = [__version__, *flags, *map(fingerprint, step.inputs)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def fingerprint(path: Path) -> str:
    """Hash of a file, or of all files in a folder, links followed: names, and contents or sizes and times."""
    digest = hashlib.sha256()
    files = sorted(Path(root, name) for root, _, names in os.walk(path, followlinks=True) for name in names)
    for file in files if path.is_dir() else [path]:
        try:
            status = file.stat()
            identity: object = (status.st_size, status.st_mtime_ns)
            if status.st_size <= _MAX_HASHED:
                identity = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            identity = error.errno
        name = file.relative_to(path).as_posix() if path.is_dir() else ""
        digest.update(f"{name}\0{identity}\0".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()
