"""A study: which people were recorded where, and the steps from there to reports and exports."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.study.steps import (
    Step,
    body_step,
    evaluate_step,
    export_step,
    ingest_step,
    map_step,
    replay_step,
)

_BAG_FILE, _BAG_SUFFIXES = "metadata.yaml", (".mcap", ".db3")


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
    is_bag = path.suffix in _BAG_SUFFIXES or (path / _BAG_FILE).is_file()
    return Source(path.stem if path.is_file() else path.name, path, is_bag) if is_bag or path.is_dir() else None


@dataclass(frozen=True)
class Place:
    """Where people were recorded.

    Attributes:
        map: an existing map.
        reference: photographs to make a map of, where there is no ``map``.
        folder: for the map, within that of the results.
    """

    name: str
    map: Path | None
    reference: Path | None
    folder: Path


@dataclass(frozen=True)
class Subject:
    """A recorded person.

    Attributes:
        body: an existing body.
        rig: which camera is on which segment; needed to make a body.
        rom: the range of motion to make a body of, where there is no ``body``.
        place: name of the place where that was recorded.
        folder: for the body, within that of the results.
    """

    name: str
    body: Path | None
    rig: Path | None
    rom: Source | None
    place: str
    folder: Path


@dataclass(frozen=True)
class Recording:
    """A recording to solve.

    Attributes:
        source: bag, or folder of videos; its name is that of the recording, unique in the study.
        subject, place: names.
        truth: reference for the evaluation.
        equipment: file, or name of a supplied one.
    """

    source: Source
    subject: str
    place: str
    truth: Path | None
    equipment: Path | str | None

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.source.name


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
        found: list[Path | str | None] = [self.path, self.lenses, self.settings]
        for place in self.places.values():
            found += [place.map, place.reference]
        for subject in self.subjects.values():
            found += [subject.body, subject.rig, subject.rom.path if subject.rom else None]
        for recording in self.recordings:
            found += [recording.source.path, recording.truth, recording.equipment]
        return tuple(dict.fromkeys(path for path in found if isinstance(path, Path)))


@dataclass(frozen=True)
class StudySteps:
    """The steps by what they make: name -> steps, each after those whose outputs it reads."""

    maps: dict[str, list[Step]]
    bodies: dict[str, list[Step]]
    recordings: dict[str, list[Step]]

    def __iter__(self) -> Iterator[Step]:
        """All of them, in an order in which they can run."""
        for kind in (self.maps, self.bodies, self.recordings):
            for steps in kind.values():
                yield from steps

    def path_to(self, recording: Recording, subject: Subject) -> list[Step]:
        """All steps that a recording depends on, and its own, in their order."""
        maps = [step for place in {subject.place, recording.place} for step in self.maps.get(place, ())]
        return [*maps, *self.bodies[subject.name], *self.recordings[recording.name]]


def study_steps(study: Study, folder: Path) -> StudySteps:
    """Every step whose inputs exist or are the outputs of earlier steps.

    Args:
        folder: for all results.
    """
    steps = StudySteps({}, {}, {})
    maps: dict[str, Path | None] = {}
    for place in study.places.values():
        made = steps.maps[place.name] = []
        maps[place.name] = place.map
        if place.map is None and place.reference is not None:
            maps[place.name] = output = folder / place.folder / "map"
            made.append(map_step(_named(place.name, "map"), place.reference, output))
    bodies: dict[str, Path | None] = {}
    for subject in study.subjects.values():
        made = steps.bodies[subject.name] = []
        bodies[subject.name] = subject.body
        if subject.body is None and subject.rom is not None:
            bag = folder / subject.folder / "rom"
            bag = _add_ingest(
                made, study, subject.rom, _named(subject.name, "ingest range of motion"), bag, subject.rig
            )
            map_path = maps.get(subject.place)
            if map_path is not None and subject.rig is not None:
                bodies[subject.name] = output = folder / subject.folder / "body.yaml"
                name = _named(subject.name, "body")
                made.append(body_step(name, bag, map_path, subject.rig, output, study.settings))
    for recording in study.recordings:
        name, results = recording.name, folder / "takes" / recording.name
        made = steps.recordings[name] = []
        rig = study.subjects[recording.subject].rig
        bag = _add_ingest(made, study, recording.source, f"{name}: ingest", results / "bag", rig)
        map_path, body, out = maps.get(recording.place), bodies[recording.subject], results / "out"
        if map_path is None or body is None:
            continue
        made.append(replay_step(f"{name}: replay", bag, map_path, body, out, study.settings, recording.equipment))
        made.append(evaluate_step(f"{name}: evaluate", out, bag, results / "report", recording.truth))
        for form in study.exports:
            file = folder / "exports" / form / f"{name}.{form}"
            made.append(export_step(f"{name}: export {form}", out, file, form))
    return steps


def _named(name: str, what: str) -> str:
    return f"{name}: {what}" if name else what


def _add_ingest(made: list[Step], study: Study, source: Source, name: str, bag: Path, rig: Path | None) -> Path:
    """The bag of a recording; a step that makes it is added where the recording is videos."""
    if source.is_bag:
        return source.path
    made.append(ingest_step(name, source.path, bag, study.lenses, rig, study.settings))
    return bag
