"""A study: which people were recorded where, and the steps from there to reports and exports."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec

from bodycam_ros.recording.bag_file import METADATA, is_bag
from bodycam_ros.replaying.first_pass import SAMPLED_SHARE

_SERIAL = ("replay stretch", "replay merge", "evaluate", "export")  # commands that take one processor
_BAGS = ("ingest", "replay", "replay stretch", "replay merge")
_MAIN_FILES = {"map": "map.yaml", **dict.fromkeys(_BAGS, METADATA), "evaluate": "summary.json"}


@dataclass(frozen=True)
class Source:
    """A recording as it was made.

    Attributes:
        path: bag, or folder of videos.
        is_bag: it needs no ingest.
    """

    name: str
    path: Path
    is_bag: bool


def find_source(path: Path) -> Source | None:
    """The recording at a path; None if there is none, or it is hidden."""
    if not path.exists() or path.name.startswith("."):
        return None
    stem = path.stem if path.is_file() else path.name
    # To the engine, braces in the name of an output are a pattern; and not every file has room for any character.
    name = "".join("_" if each in "{}" or not each.isprintable() else each for each in stem)
    return Source(name, path, is_bag(path)) if is_bag(path) or path.is_dir() else None


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of a study file as it is written there."""


class Place(Entry, frozen=True):
    """Where people were recorded.

    Attributes:
        map: an existing map.
        reference: photographs to make a map of, where there is no ``map``.
    """

    map: Path | None = None
    reference: Path | None = None


class Subject(Entry, frozen=True):
    """A recorded person.

    Attributes:
        body: an existing body.
        rig: which camera is on which segment; needed to make a body.
        range_of_motion: a recording to make the body of, where there is no ``body``.
        place: name of the place where that was recorded.
    """

    body: Path | None = None
    rig: Path | None = None
    range_of_motion: Path | None = None
    place: str | None = None

    @property
    def rom(self) -> Source | None:
        """The range of motion."""
        return None if self.range_of_motion is None else find_source(self.range_of_motion)


@dataclass(frozen=True)
class Recording(Source):
    """A recording to solve; its name is unique in the study.

    Attributes:
        subject, place: names.
        truth: reference for the evaluation.
        equipment: file, or name of a supplied one.
        stretches: how many it is solved in, each a step; None for in one go.
    """

    subject: str
    place: str
    truth: Path | None
    equipment: Path | str | None
    stretches: int | None = None


@dataclass(frozen=True)
class Study:
    """Everything that a study file, or the layout of a folder, describes.

    Attributes:
        path: of the file or folder.
        places, subjects: by name; a single one without a name is "".
        settings: ROS parameter file.
        lenses: folder with lens files of the videos.
        exports: formats.
    """

    path: Path
    places: Mapping[str, Place]
    subjects: Mapping[str, Subject]
    recordings: tuple[Recording, ...]
    settings: Path | None
    lenses: Path | None
    exports: tuple[str, ...] = ()

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files and folders that are only read."""
        found: list[object] = [self.path, self.lenses, self.settings]
        for entry in (*self.places.values(), *self.subjects.values()):
            found += msgspec.structs.astuple(entry)
        for recording in self.recordings:
            found += [recording.path, recording.truth, recording.equipment]
        return tuple(dict.fromkeys(path for path in found if isinstance(path, Path)))


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        name: unique, as "walk: replay".
        parts: of the command line, without ``--jobs``; the first is the command. Paths are inputs, or the output.
        output: file or folder that it writes.
        recording: name of the recording that it solves; empty for a step of a place or a subject.
        share: of the recording that it reads.
    """

    name: str
    parts: tuple[str | Path, ...]
    output: Path
    recording: str = ""
    share: float = 1.0

    @cached_property
    def inputs(self) -> tuple[Path, ...]:
        """Files and folders that it reads."""
        return tuple(part for part in self.parts if isinstance(part, Path) and part != self.output)

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The command line."""
        return (*self.stage.split(), *map(str, self.parts[1:]))

    @property
    def stage(self) -> str:
        """The command: "replay", or "replay merge"."""
        return str(self.parts[0])

    @property
    def main_file(self) -> Path:
        """File of the output without which that is none: of a folder one in it, else the output itself."""
        within = _MAIN_FILES.get(self.stage)
        return self.output if within is None else self.output / within

    @property
    def is_parallel(self) -> bool:
        """Whether the command takes ``--jobs``."""
        return self.stage not in _SERIAL


def study_steps(study: Study, folder: Path) -> list[Step]:
    """Every step whose inputs exist or are the outputs of earlier steps, in an order in which they can run.

    Args:
        folder: for all results.
    """
    steps: list[Step] = []

    def add(name: str, command: str, *given: str | Path, output: Path, **flags: Path | str | None) -> Path:
        known = [part for flag, value in flags.items() if value is not None for part in (f"--{flag}", value)]
        replaces = () if command == "evaluate" else ("--force",)
        steps.append(Step(name, (command, *given, *known, "-o", output, *replaces), output))
        return output

    def replayed(
        name: str, bag: Path, results: Path, count: int | None, flags: Mapping[str, Path | str | None]
    ) -> Path:
        out = results / "out"
        if count is None:
            return add(f"{name}: replay", "replay", bag, output=out, **flags)
        at, stretches, parts = len(steps), f"{name}: replay stretch", results / "stretches"
        first = add(
            f"{name}: replay first", "replay first", bag, output=parts / "first.json", stretches=str(count), **flags
        )
        all_share = {**flags, "first": first}
        solved = [
            add(
                f"{stretches} {number}",
                "replay stretch",
                bag,
                output=parts / f"{number}",
                number=f"{number}",
                **all_share,
            )
            for number in range(1, count + 1)
        ]
        add(f"{name}: replay", "replay merge", bag, *solved, output=out, **all_share)
        shares = (SAMPLED_SHARE, *[1.0 / count] * count, 1.0)
        steps[at:] = [replace(step, share=share) for step, share in zip(steps[at:], shares, strict=True)]
        return out

    def ingested(name: str, source: Source, bag: Path, rig: Path | None) -> Path:
        if source.is_bag:
            return source.path
        return add(name, "ingest", source.path, output=bag, lenses=study.lenses, rig=rig)

    maps = {name: place.map for name, place in study.places.items()}
    for name, place in study.places.items():
        if place.map is None and place.reference is not None:
            output = folder / ("places" if name else "") / name / "map"
            maps[name] = add(_named(name, "map"), "map", place.reference, output=output)
    bodies = {name: subject.body for name, subject in study.subjects.items()}
    for name, subject in study.subjects.items():
        if subject.body is None and subject.rom is not None:
            results = folder / ("subjects" if name else "") / name
            bag = ingested(_named(name, "ingest range of motion"), subject.rom, results / "rom", subject.rig)
            map_path = maps.get(subject.place or "")
            if map_path is not None and subject.rig is not None:
                flags = {"map": map_path, "rig": subject.rig, "config": study.settings}
                bodies[name] = add(_named(name, "body"), "body", bag, output=results / "body.yaml", **flags)
    for recording in study.recordings:
        first, name, results = len(steps), recording.name, folder / "takes" / recording.name
        bag = ingested(f"{name}: ingest", recording, results / "bag", study.subjects[recording.subject].rig)
        map_path, body = maps.get(recording.place), bodies[recording.subject]
        if map_path is None or body is None:
            continue
        solved: dict[str, Path | str | None] = {
            "map": map_path,
            "body": body,
            "equipment": recording.equipment,
            "config": study.settings,
        }
        out = replayed(name, bag, results, recording.stretches, solved)
        add(f"{name}: evaluate", "evaluate", out, output=results / "report", recording=bag, truth=recording.truth)
        for form in study.exports:
            add(f"{name}: export {form}", "export", out, output=folder / "exports" / form / f"{name}.{form}", to=form)
        steps[first:] = [replace(step, recording=name) for step in steps[first:]]
    return steps


def _named(name: str, what: str) -> str:
    return f"{name}: {what}" if name else what
