"""The commands that a folder of recordings needs, in their order."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.workflow.recording_folder import RecordingFolder, Source


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        name: of the step, as "walk: replay".
        words: of the command line, without the number of processes.
        inputs: files and folders that it reads.
        output: file or folder that it writes.
        is_parallel: so it knows --jobs.
    """

    name: str
    words: tuple[str, ...]
    inputs: tuple[Path, ...]
    output: Path
    is_parallel: bool = True


def steps_of(folder: RecordingFolder) -> Iterator[Step]:
    """Every step for which there is, or by then will be, what it needs."""
    solved = folder.solved
    with_settings = () if folder.settings is None else ("--config", str(folder.settings))
    words: tuple[str, ...]
    map_path = folder.map
    if map_path is None and folder.reference is not None:
        map_path = solved / "map"
        words = ("map", str(folder.reference), "-o", str(map_path), "--force")
        yield Step("map", words, (folder.reference,), map_path)
    body = folder.body
    if body is None and folder.rom is not None:
        yield from (ingest := list(_ingest(folder, folder.rom, "range of motion", solved / "rom")))
        bag = ingest[0].output if ingest else folder.rom.path
        if map_path is not None and folder.rig is not None:
            body = solved / "body.yaml"
            words = ("body", str(bag), "--map", str(map_path), "--rig", str(folder.rig), "-o", str(body), "--force")
            inputs = (bag, map_path, folder.rig, *_given(folder.settings))
            yield Step("body", (*words, *with_settings), inputs, body)
    for take in folder.takes:
        place = solved / "takes" / take.name
        yield from (ingest := list(_ingest(folder, take, take.name, place / "bag")))
        bag = ingest[0].output if ingest else take.path
        if map_path is None or body is None:
            continue
        out, report = place / "out", place / "report"
        words = ("replay", str(bag), "--map", str(map_path), "--body", str(body), "-o", str(out), "--force")
        if folder.equipment is not None:
            words += ("--equipment", str(folder.equipment))
        inputs = (bag, map_path, body, *_given(folder.settings, folder.equipment))
        yield Step(f"{take.name}: replay", (*words, *with_settings), inputs, out)
        words = ("evaluate", str(out), "--recording", str(bag), "-o", str(report))
        yield Step(f"{take.name}: evaluate", words, (out, bag), report, is_parallel=False)


def _ingest(folder: RecordingFolder, source: Source, name: str, bag: Path) -> Iterator[Step]:
    """The step that makes a bag of videos, if they are videos."""
    if source.is_bag:
        return
    words = ["ingest", str(source.path), "-o", str(bag), "--force"]
    for flag, path in (("--cameras", folder.lenses), ("--rig", folder.rig), ("--config", folder.settings)):
        words += [] if path is None else [flag, str(path)]
    inputs = (source.path, *_given(folder.lenses, folder.rig, folder.settings))
    yield Step(f"{name}: ingest", tuple(words), inputs, bag)


def _given(*paths: Path | None) -> tuple[Path, ...]:
    return tuple(path for path in paths if path is not None)
