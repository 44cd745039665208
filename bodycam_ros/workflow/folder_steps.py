"""The commands that a folder of recordings needs, in their order."""

from collections.abc import Iterator
from pathlib import Path

from bodycam_ros.workflow.recording_folder import RecordingFolder, Source
from bodycam_ros.workflow.step import Step, body_step, evaluate_step, ingest_step, map_step, replay_step


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
