"""Which steps are done for the present state of what they read: a note of each beside what it wrote.

A step's name begins with what it is about where there are several of its stage: "walk: replay".
"""

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from bodycam_ros import __version__
from bodycam_ros.errors import OutputError, RecordingError
from bodycam_ros.whole_file import write_whole


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        name: of the step, as "walk: replay".
        words: of the command line, without the number of processes; the first is the stage.
        inputs: files and folders that it reads.
        output: file or folder that it writes.
        is_parallel: so it knows --jobs.
        beside: what else it writes.
    """

    name: str
    words: tuple[str, ...]
    inputs: tuple[Path, ...]
    output: Path
    is_parallel: bool = True
    beside: tuple[Path, ...] = ()

    @property
    def stage(self) -> str:
        """The command: "replay"."""
        return self.words[0]


def map_step(name: str, reference: Path, output: Path) -> Step:
    """Photographs of a place -> its map."""
    return Step(name, ("map", str(reference), "-o", str(output), "--force"), (reference,), output)


def ingest_step(
    name: str, videos: Path, output: Path, lenses: Path | None, rig: Path | None, settings: Path | None
) -> Step:
    """A folder of videos -> a bag."""
    words = ("ingest", str(videos), "-o", str(output), "--force")
    flags = (*_flag("--cameras", lenses), *_flag("--rig", rig), *_flag("--config", settings))
    beside = output.with_name(f"{output.name}_timing")
    return Step(name, (*words, *flags), (videos, *_given(lenses, rig, settings)), output, beside=(beside,))


def body_step(name: str, bag: Path, map_path: Path, rig: Path, output: Path, settings: Path | None) -> Step:
    """A range of motion -> a body."""
    words = ("body", str(bag), "--map", str(map_path), "--rig", str(rig), "-o", str(output), "--force")
    inputs = (bag, map_path, rig, *_given(settings))
    return Step(name, (*words, *_flag("--config", settings)), inputs, output, beside=(output.with_suffix(".html"),))


def replay_step(
    name: str,
    bag: Path,
    map_path: Path,
    body: Path,
    output: Path,
    settings: Path | None,
    equipment: Path | str | None,
) -> Step:
    """A recording -> a bag with joint states.

    Args:
        equipment: a file, or the name of what is supplied.
    """
    words = ("replay", str(bag), "--map", str(map_path), "--body", str(body), "-o", str(output), "--force")
    flags = (*_flag("--equipment", equipment), *_flag("--config", settings))
    of_equipment = (equipment,) if isinstance(equipment, Path) else ()
    return Step(name, (*words, *flags), (bag, map_path, body, *_given(settings), *of_equipment), output)


def evaluate_step(name: str, solved: Path, bag: Path, output: Path, truth: Path | None = None) -> Step:
    """A solved recording -> a report."""
    words = ("evaluate", str(solved), "--recording", str(bag), *_flag("--truth", truth), "-o", str(output))
    return Step(name, words, (solved, bag, *_given(truth)), output, is_parallel=False)


def export_step(name: str, solved: Path, output: Path, format_name: str) -> Step:
    """A solved recording -> a file for other programs."""
    words = ("export", str(solved), "--to", format_name, "-o", str(output), "--force")
    return Step(name, words, (solved,), output, is_parallel=False)


def _flag(name: str, value: Path | str | None) -> Sequence[str]:
    return () if value is None else (name, str(value))


def _given(*paths: Path | None) -> tuple[Path, ...]:
    return tuple(path for path in paths if path is not None)


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


_BAG_FILE, _BAG_SUFFIXES = "metadata.yaml", (".mcap", ".db3")

LAYOUT = """\
    reference/      photographs of the place, camera.yaml, board.yaml
    map/            instead of these, a map that is ready
    rig.yaml        which camera is on which segment
    rom/            the range of motion: a ros2 bag, or videos
    body.yaml       instead of these, a body that is ready
    takes/NAME/     what is to be solved: ros2 bags, or folders of videos
    lenses/         lens YAMLs of the videos, where they are not beside them
    settings.yaml   ROS parameter file for ingest, body and replay
    equipment.yaml  what the person rides, holds or stands on
    solved/         all that is made of it: map, body, takes/NAME

A map, a body, what they are made of, and one take at least; all else may be left
out. Any of it may be a link to somewhere else.
"""
"""What a folder should look like, for help and messages."""


@dataclass(frozen=True)
class Source:
    """A recording as it was made.

    Attributes:
        name: of it.
        path: bag, or folder of videos.
        is_bag: so it needs no ingest.
    """

    name: str
    path: Path
    is_bag: bool


@dataclass(frozen=True)
class RecordingFolder:
    """What is there; None for what is not.

    Attributes:
        path: of the folder.
        rom: the range of motion.
        takes: by name.
    """

    path: Path
    reference: Path | None
    map: Path | None
    rig: Path | None
    rom: Source | None
    body: Path | None
    takes: tuple[Source, ...]
    lenses: Path | None
    settings: Path | None
    equipment: Path | None

    @property
    def solved(self) -> Path:
        """Where everything goes that is made."""
        return self.path / "solved"

    @classmethod
    def look_into(cls, path: Path) -> "RecordingFolder":
        """Find out what is there.

        Raises:
            RecordingError: it is no folder, holds nothing of what it should, or two takes of the same name.
        """
        if not path.is_dir():
            raise RecordingError(f"{path}: is no folder; expected one with\n{LAYOUT}")
        takes = path / "takes"
        found = cls(
            path,
            reference=_there(path / "reference"),
            map=_there(path / "map"),
            rig=_there(path / "rig.yaml"),
            rom=source_at(path / "rom"),
            body=_there(path / "body.yaml"),
            takes=tuple(s for each in sorted(takes.iterdir()) if (s := source_at(each))) if takes.is_dir() else (),
            lenses=_there(path / "lenses"),
            settings=_there(path / "settings.yaml"),
            equipment=_there(path / "equipment.yaml"),
        )
        by_name: dict[str, Path] = {}
        for take in found.takes:
            if (other := by_name.setdefault(take.name, take.path)) != take.path:
                raise RecordingError(f"{take.path}: is a take of the same name as {other}; rename one of the two")
        if found.rom is None and not found.takes and found.reference is None:
            raise RecordingError(f"{path}: holds nothing that could be solved; expected\n{LAYOUT}")
        return found

    def missing(self) -> list[str]:
        """What lacks for the way to its end, in sentences."""
        lacks = []
        if self.map is None and self.reference is None:
            lacks.append("reference/ with photographs of the place (or map/): without a map nothing can be solved")
        if self.body is None and self.rom is None:
            lacks.append("rom/ with a range of motion (or body.yaml): without a body no take can be solved")
        if self.body is None and self.rom is not None and self.rig is None:
            lacks.append("rig.yaml, which says on which segment each camera is: without it no body can be made")
        if not self.takes:
            lacks.append("takes/NAME/ with what is to be solved")
        return lacks


def _there(path: Path) -> Path | None:
    return path if path.exists() else None


def source_at(path: Path) -> Source | None:
    """A recording; None if there is none of that name, or it is hidden."""
    if not path.exists() or path.name.startswith("."):
        return None
    is_bag = path.suffix in _BAG_SUFFIXES or (path / _BAG_FILE).is_file()
    return Source(path.stem if path.is_file() else path.name, path, is_bag) if is_bag or path.is_dir() else None


def steps_of(folder: RecordingFolder) -> Iterator[Step]:
    """Every step for which there is, or by then will be, what it needs."""
    solved = folder.solved
    map_path = folder.map
    if map_path is None and folder.reference is not None:
        map_path = solved / "map"
        yield map_step("map", folder.reference, map_path)
    body = folder.body
    if body is None and folder.rom is not None:
        yield from (ingest := list(_ingest(folder, folder.rom, "range of motion", solved / "rom")))
        bag = ingest[0].output if ingest else folder.rom.path
        if map_path is not None and folder.rig is not None:
            body = solved / "body.yaml"
            yield body_step("body", bag, map_path, folder.rig, body, folder.settings)
    for take in folder.takes:
        place = solved / "takes" / take.name
        yield from (ingest := list(_ingest(folder, take, take.name, place / "bag")))
        bag = ingest[0].output if ingest else take.path
        if map_path is None or body is None:
            continue
        out = place / "out"
        yield replay_step(f"{take.name}: replay", bag, map_path, body, out, folder.settings, folder.equipment)
        yield evaluate_step(f"{take.name}: evaluate", out, bag, place / "report")


def _ingest(folder: RecordingFolder, source: Source, name: str, bag: Path) -> Iterator[Step]:
    """The step that makes a bag of videos, if they are videos."""
    if not source.is_bag:
        yield ingest_step(f"{name}: ingest", source.path, bag, folder.lenses, folder.rig, folder.settings)
