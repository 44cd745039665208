"""Reads what is to be solved: a study file (``docs/study.md``), or a folder of recordings of one person in one place.

All of it is checked before anything is run.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NoReturn

import msgspec

from bodycam_ros.errors import BodyError, OutputError, RecordingError, StudyError
from bodycam_ros.files.output_place import check_output
from bodycam_ros.files.shown import other_than
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.study.study import Entry, Place, Recording, Source, Study, Subject, find_source
from bodycam_ros.study.study_lock import LOCK

_Name = Annotated[str, msgspec.Meta(pattern=r"^[\w-][\w.-]{0,99}$")]
"""A folder's name on every system, which needs no quotes in a shell."""
_Text = Annotated[str, msgspec.Meta(min_length=1)]


class _RecordingEntry(Entry, frozen=True):
    path: _Text
    name: _Name | None = None
    subject: str | None = None
    place: str | None = None
    truth: _Text | None = None
    equipment: _Text | None = None
    stretches: Annotated[int, msgspec.Meta(ge=1, le=10_000)] | None = None


class _StudyEntry(Entry, frozen=True):
    places: Annotated[dict[_Name, Place], msgspec.Meta(min_length=1)]
    subjects: Annotated[dict[_Name, Subject], msgspec.Meta(min_length=1)]
    recordings: Annotated[list[_RecordingEntry], msgspec.Meta(min_length=1)]
    settings: Path | None = None
    lenses: Path | None = None
    equipment: _Text | None = None
    exports: list[str] = []


def read_study(path: Path) -> Study:
    """The study that a file describes.

    Raises:
        StudyError: it cannot be read, or describes something impossible; the message names file and key.
    """
    # Absolute, as all paths in it then are: no path is taken for a command or a name in the words of a step.
    return _StudyReader(path.absolute()).read()


class _StudyReader:
    """Resolves the paths and names of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self) -> Study:
        document = read_yaml(self._path, "study file", StudyError)
        try:
            entry = msgspec.convert(document, _StudyEntry, dec_hook=lambda _, text: self._below(text))
        except msgspec.ValidationError as error:
            raise StudyError(f"{self._path}: {str(error).replace('`', '')}") from error
        self._check_paths("", entry)
        for name, place in entry.places.items():
            if (place.map is None) == (place.reference is None):
                self._refuse(
                    f"places.{name}", "needs either map, an existing one, or reference, a folder of photographs"
                )
            self._check_paths(f"places.{name}.", place)
        subjects = {name: self._subject(f"subjects.{name}", each, entry) for name, each in entry.subjects.items()}
        recordings: dict[str, Recording] = {}
        for number, each in enumerate(entry.recordings):
            key = f"recordings[{number}]"
            for recording in self._recordings(key, each, entry):
                if (other := recordings.setdefault(recording.name, recording)) is not recording:
                    self._refuse(
                        key,
                        f"{recording.path} and {other.path} would both have the name {recording.name}; "
                        "list them apart, with a name each",
                    )
        from bodycam_ros.formats.export import FORMATS

        for number, name in enumerate(entry.exports):
            if name not in FORMATS:
                known = other_than(name, FORMATS)
                self._refuse(f"exports[{number}]", f"'{name}' is no format of 'bodycam export'; {known}")
        found, exports = tuple(recordings.values()), tuple(dict.fromkeys(entry.exports))
        return Study(self._path, entry.places, subjects, found, entry.settings, entry.lenses, exports)

    def _below(self, text: object) -> Path:
        """A path from the folder of the study file on."""
        try:
            return self._path.parent / msgspec.convert(text, _Text)
        except msgspec.ValidationError as error:
            raise ValueError(str(error)) from error  # to which msgspec adds the place in the file

    def _subject(self, key: str, subject: Subject, entry: _StudyEntry) -> Subject:
        if (subject.body is None) == (subject.range_of_motion is None):
            self._refuse(key, "needs either body, an existing one, or range_of_motion, a recording to make one of")
        self._check_paths(f"{key}.", subject)
        if subject.range_of_motion is None:
            return subject
        if subject.rig is None:
            self._refuse(key, "lacks rig, which says on which segment each camera is: without it no body can be made")
        self._source(f"{key}.range_of_motion", subject.range_of_motion)
        return msgspec.structs.replace(subject, place=self._chosen(key, "place", subject.place, entry.places))

    def _recordings(self, key: str, each: _RecordingEntry, entry: _StudyEntry) -> Iterator[Recording]:
        subject = self._chosen(key, "subject", each.subject, entry.subjects)
        place = self._chosen(key, "place", each.place, entry.places)
        equipment = self._equipment(f"{key}.equipment", each.equipment or entry.equipment)
        if each.stretches is not None and equipment is not None:
            self._refuse(f"{key}.stretches", "a recording with equipment is not solved in stretches; leave it out")
        for source in self._sources(f"{key}.path", each.path, each.name):
            truth = each.truth and each.truth.replace("{name}", source.name).replace("{path}", str(source.path))
            known = None if truth is None else self._existing(f"{key}.truth", self._below(truth))
            yield Recording(
                **vars(source),
                subject=subject,
                place=place,
                truth=known,
                equipment=equipment,
                stretches=each.stretches,
            )

    def _sources(self, key: str, text: str, name: str | None) -> Iterator[Source]:
        """The recordings that a path or pattern means, in the order of their names.

        A single recording has the name of its file or folder. With a pattern all parts of the path from the first with
        a wildcard to the last make the name, joined by ``_``; characters that no folder should have become ``_``.
        Hidden paths, and results of a study, are left out.
        """
        parts = Path(text).parts
        wild = [index for index, part in enumerate(parts) if _WILDCARD.search(part)]
        if not wild:
            source = self._source(key, self._existing(key, self._below(text)))
            yield replace(source, name=name or folder_name(source.name))
            return
        if name is not None:
            self._refuse(key, "name belongs to one recording; leave it out where path has wildcards")
        fixed = self._path.parent.joinpath(*parts[: wild[0]])
        below = len(parts) - 1 - wild[-1]
        found = False
        for path in sorted(fixed.glob(str(Path(*parts[wild[0] :])))):
            if (lacking := _missing_target(path)) is not None:
                self._refuse(key, f"{path} is a link to {lacking}, which does not exist")
            if (source_there := find_source(path)) is not None and not _is_result(path, fixed):
                found = True
                named = path.with_name(source_there.name).relative_to(fixed).parts
                yield replace(source_there, name=folder_name("_".join(named[: len(named) - below])))
        if not found:
            self._refuse(key, f"no recording fits {self._path.parent.joinpath(*parts)}")

    def _source(self, key: str, path: Path) -> Source:
        if (source := find_source(path)) is None:
            self._refuse(key, f"{path} is neither a ros2 bag nor a folder of videos")
        return source

    def _check_paths(self, key: str, entry: Entry) -> None:
        for name, value in msgspec.structs.asdict(entry).items():
            if isinstance(value, Path):
                self._existing(key + name, value)

    def _existing(self, key: str, path: Path) -> Path:
        try:
            exists = path.exists()
        except (OSError, ValueError):
            exists = False
        if not exists:
            self._refuse(key, f"{path} does not exist")
        return path

    def _chosen(self, key: str, what: str, name: str | None, known: Mapping[str, object]) -> str:
        """One of the study's places or subjects, which may be left out where there is one only."""
        if name is None and len(known) == 1:
            return next(iter(known))
        if name is None:
            self._refuse(key, f"lacks {what}; there are {', '.join(known)}")
        if name not in known:
            self._refuse(f"{key}.{what}", f"'{name}' is no {what} of this study; {other_than(name, known)}")
        return name

    def _equipment(self, key: str, text: str | None) -> Path | str | None:
        """A file, or the name of a supplied one."""
        from bodycam_ros.body.equipment_yaml import equipment_path, supplied_equipment

        if text is None or text in supplied_equipment():
            return text
        if not self._below(text).exists():
            try:
                equipment_path(text)
            except BodyError as error:
                self._refuse(key, str(error))
        return self._existing(key, self._below(text))

    def _refuse(self, key: str, problem: str) -> NoReturn:
        raise StudyError(f"{self._path}: {key}: {problem}")


_WILDCARD = re.compile(r"[*?\[]")
_NOT_PLAIN = re.compile(r"[^\w.-]+|^\.")


def _missing_target(path: Path) -> str | None:
    """Where a link leads if nothing is there, as without its disk; None of hidden links, as editors make them."""
    is_broken = path.is_symlink() and not path.exists() and not path.name.startswith(".")
    return os.readlink(path) if is_broken else None


def _is_result(path: Path, within: Path) -> bool:
    """Whether a path lies in the folder of a study's results, or is one."""
    above = path.relative_to(within).parents
    return any((folder / LOCK).exists() for folder in (path, *(within / each for each in above)))


def folder_name(name: str) -> str:
    """A name that may be a folder's on every system, and needs no quotes in a shell."""
    return _NOT_PLAIN.sub("_", name)


def check_results_folder(path: Path, study: Study) -> Path:
    """The folder for a study's results, links followed; it need not exist.

    Raises:
        OutputError: it contains an input, or something that is not a study's.
    """
    check_output(path, study.inputs)
    if path.exists() and (not path.is_dir() or (any(path.iterdir()) and not (path / LOCK).exists())):
        raise OutputError(f"{path}: exists, and is no folder of a study (it has no {LOCK}); choose another name")
    return Path(os.path.realpath(path))


LAYOUT = """\
    reference/      photographs of the place, camera.yaml, board.yaml
    map/            instead of these: an existing map
    rig.yaml        which camera is on which segment
    rom/            the range of motion: a ros2 bag, or videos
    body.yaml       instead of these: an existing body
    takes/NAME/     what is to be solved: ros2 bags, or folders of videos
    lenses/         lens YAMLs of the videos, where they are not beside them
    settings.yaml   ROS parameter file for body and replay
    equipment.yaml  what the person rides, holds or stands on
    solved/         all results: map, body, takes/NAME

Needed are a map, a body, or what they are made of, and one take. Any of it may
be a link to another place.
"""
"""The layout, for help and messages."""

SOLVED = "solved"


def read_recording_folder(path: Path) -> Study:
    """The study of a folder that is laid out as ``LAYOUT`` shows.

    Raises:
        RecordingError: no folder, nothing in it that could be solved, a link that leads nowhere, or two takes of the
            same name.
    """
    if not path.is_dir():
        raise RecordingError(f"{path}: is no folder; expected one with\n{LAYOUT}")
    names = ("reference", "map", "rig.yaml", "body.yaml", "lenses", "settings.yaml", "equipment.yaml")
    takes = sorted((path / "takes").iterdir()) if (path / "takes").is_dir() else []
    for part in (*(path / name for name in (*names, "rom", "takes")), *takes):
        if (lacking := _missing_target(part)) is not None:
            raise RecordingError(f"{part}: is a link to {lacking}, which does not exist; mend the link or remove it")
    there = {name: path / name for name in names if (path / name).exists()}
    sources = [source for take in takes if (source := find_source(take)) is not None]
    by_name: dict[str, Path] = {}
    for source in sources:
        if (other := by_name.setdefault(source.name, source.path)) != source.path:
            raise RecordingError(f"{source.path}: is a take of the same name as {other}; rename one of the two")
    rom = find_source(path / "rom")
    if rom is None and not sources and "reference" not in there:
        raise RecordingError(f"{path}: holds nothing that could be solved; expected\n{LAYOUT}")
    place = Place(there.get("map"), there.get("reference"))
    subject = Subject(there.get("body.yaml"), there.get("rig.yaml"), rom.path if rom else None)
    equipment = there.get("equipment.yaml")
    recordings = (
        Recording(each.name, each.path, each.is_bag, "", "", truth=None, equipment=equipment) for each in sources
    )
    return Study(path, {"": place}, {"": subject}, tuple(recordings), there.get("settings.yaml"), there.get("lenses"))


def list_missing(study: Study) -> list[str]:
    """What a folder lacks to be solved, in sentences."""
    place, subject = study.places[""], study.subjects[""]
    lacks = []
    if place.map is None and place.reference is None:
        lacks.append("reference/ with photographs of the place (or map/): without a map nothing can be solved")
    if subject.body is None and subject.rom is None:
        lacks.append("rom/ with a range of motion (or body.yaml): without a body no take can be solved")
    if subject.body is None and subject.rom is not None and subject.rig is None:
        lacks.append("rig.yaml, which says on which segment each camera is: without it no body can be made")
    if not study.recordings:
        lacks.append("takes/NAME/ with what is to be solved")
    return lacks
