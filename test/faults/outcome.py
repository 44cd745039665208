"""What came of a run: a good result, an error that names what is wrong, or a fault of ours."""

import hashlib
import json
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
from faults.run import Run

from bodycam_ros.body.body_file import read_body
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.reference_map import ReferenceMap

SURVIVED = "survived"
NAMED = "named"
FAULTY = "faulty"
FAULTS = ("traceback", "half file", "hang", "unreadable", "silent", "good refused")
TRACEBACK, HALF, HANG, UNREADABLE, SILENT, REFUSED = FAULTS
"""Unreadable: escape sequences, or more text than anybody reads. Silent: a wrong result that nobody is told of."""

_STACKS = re.compile(r"Traceback \(most recent call last\)|terminate called|stack trace: \*\*\*|Fatal Python error")
_OURS = re.compile(r'File "[^"]*bodycam_ros')
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\x80-\x9f]")
_LONGEST_MESSAGE = 4000
_TABLE = "│┃┏┡└┌├─╇┴"

Snapshot = Mapping[Path, str]


@dataclass(frozen=True)
class Outcome:
    """How a case ended.

    Attributes:
        result: ``SURVIVED`` (exit code 0), ``NAMED`` or ``FAULTY``.
        faults: what is ours to mend -> in some words.
        said: the last line that was printed.
        memory_mb: of the largest process.
        inputs: name of each input of the stock that was the case's own -> whether the run opened a file of it: a run
            that stops before proves nothing about what was damaged.
    """

    result: str
    faults: Mapping[str, str]
    said: str
    memory_mb: float
    inputs: Mapping[str, bool]


def snapshot(folder: Path) -> Snapshot:
    """What is in a folder: path -> what it is and holds."""
    found = {}
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent) / name
            mode = path.lstat().st_mode
            if stat.S_ISLNK(mode):
                found[path] = f"link to {os.readlink(path)}"
            elif stat.S_ISREG(mode):
                found[path] = hashlib.sha1(path.read_bytes()).hexdigest()
            else:
                found[path] = str(stat.S_IFMT(mode))
    return found


def judged(run: Run, before: Snapshot, stock: Path) -> Outcome:
    """What came of a run in a folder that was so before, with copies of the stock's inputs."""
    text = run.printed.decode("utf-8", "replace")
    faults = {}
    if run.hung:
        faults[HANG] = run.hung
    elif run.left:
        faults[HANG] = f"left {run.left} processes behind"
    elif stack := _stack(run, text):
        faults[TRACEBACK] = stack
    if run.attempt.stop is None and (unreadable := _unreadable(run, text)):
        faults[UNREADABLE] = unreadable
    if half := _half_written(run, before):
        faults[HALF] = half
    beside_tables = "\n".join(line for line in text.splitlines() if not set(line) & set(_TABLE))
    if run.exit_code == 0 and run.attempt.must_say and not re.search(run.attempt.must_say, beside_tables):
        faults[SILENT] = f"nothing was said that matches {run.attempt.must_say!r}"
    if run.attempt.is_good and run.exit_code:
        faults[REFUSED] = f"exit code {run.exit_code}"
    result = FAULTY if faults else SURVIVED if run.exit_code == 0 else NAMED
    lines = [line for line in text.splitlines() if line.strip()]
    own = {path.relative_to(run.folder).parts[0] for path in before}
    opened = {path.relative_to(run.folder).parts[0] for path in run.opened}
    inputs = {name: name in opened for name in sorted(own) if (stock / name).exists()}
    return Outcome(result, faults, lines[-1][:300] if lines else "", run.memory_mb, inputs)


def _stack(run: Run, text: str) -> str:
    """What shows that the program fell over; empty if it did not."""
    code = run.exit_code
    in_python = run.attempt.stop is not None and not _OURS.search(text)  # before any line of ours could run
    if not in_python and (match := _STACKS.search(text)):
        last = [line for line in text[match.start() :].splitlines() if line and not line.startswith(" ")]
        return next((line for line in last[1:] if "Error" in line or "Exception" in line), last[-1])[:200]
    stopped_by = run.attempt.stop[0] if run.attempt.stop else 0
    if code is None or (code < 0 and -code != stopped_by):
        return f"ended by signal {-(code or 0)}"
    if code == 1 and not in_python and "bodycam: error: " not in text:
        return "exit code 1 without a word"
    return ""


def _unreadable(run: Run, text: str) -> str:
    if match := _CONTROL.search(text):
        return f"control character {match[0]!r} in {text[max(0, match.start() - 30) : match.end() + 30]!r}"
    longest = max((len(part) for part in text.split("bodycam: error: ")[1:]), default=0)
    longest -= sum(map(len, run.attempt.arguments))  # a message may name a path, however long
    return f"a message of {longest} characters" if longest > _LONGEST_MESSAGE else ""


def _half_written(run: Run, before: Snapshot) -> str:
    """What is in the folder that should not be, or is no longer as it should; empty if all is well."""
    outputs = _places(run)
    after = snapshot(run.folder)
    changed = {path for path in after.keys() | before.keys() if after.get(path) != before.get(path)}
    changed.discard(run.folder / "tmp")
    for path in sorted(changed):
        name = path.relative_to(run.folder)
        within = [out for out in outputs if _within(path, out)]
        # Where the whole folder is the output, what was there before is to stay all the same.
        if path in before and not set(within) - {run.folder}:
            return f"{name} was changed" if path in after else f"{name} is gone"
        # The folders on the way to an output may be made.
        if not within and (run.exit_code or not any(_within(out, path) for out in outputs)):
            return f"{name} was left behind"
    for out, kind in outputs.items():
        if any(_within(path, out) for path in changed) and (why := _not_whole(out, kind)):
            return f"{out.name}: {why}"
    return ""


def _places(run: Run) -> Mapping[Path, str]:
    """Where outputs may be, with their kinds; links are followed, too. Nothing above the case's folder."""
    places = {}
    for out, kind in run.attempt.outputs.items():
        for place in map(Path, (os.path.normpath(run.folder / out), os.path.realpath(run.folder / out))):
            if place == run.folder or not _within(run.folder, place):
                places[place] = kind
    return places


def _within(path: Path, folder: Path) -> bool:
    return path == folder or folder in path.parents


def _not_whole(path: Path, kind: str) -> str:
    """Why an output cannot be read again; empty if it can."""
    try:
        if kind == "bag":
            with BagFile(path) as bag:
                states = sum(1 for _ in bag.messages(["/joint_states"]))
            return "" if states else "holds no joint states"
        if kind == "report":
            json.loads((path / "summary.json").read_text())
            picture = np.frombuffer((path / "summary.png").read_bytes(), np.uint8)
            return "" if cv2.imdecode(picture, cv2.IMREAD_COLOR) is not None else "holds no picture"
        if kind == "file":
            return "" if path.stat().st_size else "is empty"
        if kind == "page":
            return "" if path.read_text().rstrip().endswith("</html>") else "is cut"
        if kind == "urdf":
            ElementTree.parse(path)
        elif kind == "body":
            read_body(path)
        else:
            ReferenceMap.load(path)
    except Exception as error:  # whatever makes it unreadable
        return f"{type(error).__name__}: {error}"[:200]
    return ""
