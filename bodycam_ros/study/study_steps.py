"""The steps of a study: those of ``bodycam run``, with bodies and maps that recordings share."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bodycam_ros.study.study import Recording, Study, Subject
from bodycam_ros.workflow.recording_folder import Source
from bodycam_ros.workflow.step import Step, body_step, evaluate_step, export_step, ingest_step, map_step, replay_step

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
