"""A study: who was recorded where, and what is to be made of it. ``docs/study.md`` describes the file that says it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.workflow.recording_folder import Source

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
