"""A study: who was recorded where, and what is to be made of it. ``docs/study.md`` describes the file that says it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.study.steps import (
    Source,
    Step,
    body_step,
    evaluate_step,
    export_step,
    ingest_step,
    map_step,
    replay_step,
)

STAGES = ("map", "ingest", "body", "replay", "evaluate", "export")
"""In their order; each is a command of ``bodycam`` and a rule of the workflow."""


@dataclass(frozen=True)
class Place:
    """Where people were recorded; one of the two is given.

    Attributes:
        map: that is ready.
        reference: photographs to make a map of.
    """

    name: str
    map: Path | None
    reference: Path | None


@dataclass(frozen=True)
class Subject:
    """Who was recorded.

    Attributes:
        body: that is ready.
        rig: which camera is on which segment; where there is no body it is needed.
        rom: the range of motion to make a body of.
        place: name of the place where that was recorded.
    """

    name: str
    body: Path | None
    rig: Path | None
    rom: Source | None
    place: str | None


@dataclass(frozen=True)
class Recording:
    """What is to be solved.

    Attributes:
        source: bag, or folder of videos; its name is that of the recording.
        subject: name of who it is.
        place: name of where it is.
        truth: what it is to be measured against.
        equipment: file, or name of what is supplied.
    """

    source: Source
    subject: str
    place: str
    truth: Path | None
    equipment: Path | str | None

    @property
    def name(self) -> str:
        """Of the recording, unique in the study."""
        return self.source.name


@dataclass(frozen=True)
class StageResources:
    """What one job of a stage gets; None: what is usual.

    Attributes:
        threads: processes or threads.
        memory_mb: [MB].
    """

    threads: int | None = None
    memory_mb: int | None = None


@dataclass(frozen=True)
class Study:
    """All of it.

    Attributes:
        path: of the file.
        places: by name.
        subjects: by name.
        recordings: in the order of the file.
        settings: a ROS parameter file, or group -> setting -> value; None: defaults.
        lenses: folder of lens files of videos.
        exports: formats.
        resources: stage -> what is said of it.
    """

    path: Path
    places: Mapping[str, Place]
    subjects: Mapping[str, Subject]
    recordings: tuple[Recording, ...]
    settings: Path | Mapping[str, Any] | None
    lenses: Path | None
    exports: tuple[str, ...]
    resources: Mapping[str, StageResources]

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files and folders that are only read."""
        found: list[Path | None] = [self.path, self.lenses, self.settings if isinstance(self.settings, Path) else None]
        for place in self.places.values():
            found += [place.map, place.reference]
        for subject in self.subjects.values():
            found += [subject.body, subject.rig, subject.rom.path if subject.rom else None]
        for recording in self.recordings:
            equipment = recording.equipment
            found += [recording.source.path, recording.truth, equipment if isinstance(equipment, Path) else None]
        return tuple(dict.fromkeys(path for path in found if path is not None))


PLACES, SUBJECTS, TAKES, EXPORTS = "places", "subjects", "takes", "exports"
"""Folders of the output: a folder each of places, subjects and recordings in them; of exports one a format."""

SETTINGS = "settings.yaml"
"""Name of the file that settings of the study file are written to."""


@dataclass(frozen=True)
class StudySteps:
    """What is to be done.

    Attributes:
        of_places: name -> its steps.
        of_subjects: name -> its steps.
        of_recordings: name -> its steps.
    """

    of_places: dict[str, list[Step]]
    of_subjects: dict[str, list[Step]]
    of_recordings: dict[str, list[Step]]

    def __iter__(self) -> Iterator[Step]:
        """All of them, each after those that it needs."""
        for kind in (self.of_places, self.of_subjects, self.of_recordings):
            for steps in kind.values():
                yield from steps

    def way_to(self, recording: Recording, subject: Subject) -> list[Step]:
        """All steps that a recording needs, in their order."""
        places = dict.fromkeys((*([subject.place] if subject.place else []), recording.place))
        shared = [step for place in places for step in self.of_places[place]]
        return [*shared, *self.of_subjects[subject.name], *self.of_recordings[recording.name]]


def study_steps(study: Study, folder: Path) -> StudySteps:
    """The steps.

    Args:
        study: what is said.
        folder: where everything goes that is made.
    """
    settings = study.settings if study.settings is None or isinstance(study.settings, Path) else folder / SETTINGS
    maps: dict[str, Path] = {}
    steps = StudySteps({}, {}, {})
    for place in study.places.values():
        made = steps.of_places[place.name] = []
        if place.reference is not None:
            made.append(map_step(f"{place.name}: map", place.reference, folder / PLACES / place.name / "map"))
        maps[place.name] = made[0].output if made else place.map or Path()
    bodies: dict[str, Path] = {}
    for subject in study.subjects.values():
        made = steps.of_subjects[subject.name] = []
        at = folder / SUBJECTS / subject.name
        if subject.rom is not None and subject.rig is not None and subject.place is not None:
            bag = _bag(
                made, subject.rom, f"{subject.name}: ingest range of motion", at, study.lenses, subject.rig, settings
            )
            made.append(
                body_step(f"{subject.name}: body", bag, maps[subject.place], subject.rig, at / "body.yaml", settings)
            )
        bodies[subject.name] = made[-1].output if made else subject.body or Path()
    for recording in study.recordings:
        name, at = recording.name, folder / TAKES / recording.name
        made = steps.of_recordings[name] = []
        rig = study.subjects[recording.subject].rig
        bag = _bag(made, recording.source, f"{name}: ingest", at, study.lenses, rig, settings)
        body, out = bodies[recording.subject], at / "out"
        made.append(
            replay_step(f"{name}: replay", bag, maps[recording.place], body, out, settings, recording.equipment)
        )
        made.append(evaluate_step(f"{name}: evaluate", out, bag, at / "report", recording.truth))
        for form in study.exports:
            made.append(export_step(f"{name}: export {form}", out, folder / EXPORTS / form / f"{name}.{form}", form))
    return steps


def _bag(
    made: list[Step],
    source: Source,
    name: str,
    at: Path,
    lenses: Path | None,
    rig: Path | None,
    settings: Path | None,
) -> Path:
    """The bag of a recording; where it is videos, the step that makes it is added."""
    if source.is_bag:
        return source.path
    made.append(ingest_step(name, source.path, at / "bag", lenses, rig, settings))
    return made[-1].output
