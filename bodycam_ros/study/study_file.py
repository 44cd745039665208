"""Reads a study file, whose format ``docs/study.md`` describes, and checks all of it before anything is run."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bodycam_ros.errors import BodyError, SettingsError, StudyError
from bodycam_ros.study.corrected_bodies import recordings_at
from bodycam_ros.study.steps import Source, source_at
from bodycam_ros.study.study import STAGES, Place, Recording, StageResources, Study, Subject
from bodycam_ros.study.study_field import PLAIN_NAME, StudyField
from bodycam_ros.yaml_file import read_yaml

_KEYS = ("places", "subjects", "recordings", "settings", "lenses", "equipment", "exports", "resources")
_OF_RECORDING = ("path", "name", "subject", "place", "truth", "equipment")
_MOST_THREADS, _MOST_MEMORY_MB = 1024, 4_000_000


def read_study(path: Path) -> Study:
    """The study that a file describes.

    Raises:
        StudyError: it cannot be read, or says something that cannot be done; the message names file and key.
    """
    # Absolute, as all paths in it then are: no path is mistaken for a command or a name in the words of a step.
    path = path.absolute()
    document = StudyField(path, "", read_yaml(path, "study file", StudyError))
    fields = document.table(_KEYS, needed=("places", "subjects", "recordings"))
    places = {name: _place(name, field) for name, field in _named(fields["places"])}
    subjects = {name: _subject(name, field, places) for name, field in _named(fields["subjects"])}
    equipment = _equipment(fields.get("equipment"))
    recordings: dict[str, Recording] = {}
    for field in fields["recordings"].listed():
        for recording in _recordings(field, subjects, places, equipment):
            if (other := recordings.setdefault(recording.name, recording)) is not recording:
                field.refuse(
                    f"{recording.source.path} and {other.source.path} would both have the name {recording.name}; list "
                    "them apart, with a name each"
                )
    return Study(
        path,
        places,
        subjects,
        tuple(recordings.values()),
        _settings(fields.get("settings")),
        fields["lenses"].place() if "lenses" in fields else None,
        _exports(fields.get("exports")),
        _resources(fields.get("resources")),
    )


def _named(field: StudyField) -> Iterator[tuple[str, StudyField]]:
    fields = dict(field.named())
    if not fields:
        field.refuse("is empty; say one at least")
    for name, each in fields.items():
        if not PLAIN_NAME.fullmatch(name):
            each.refuse("names here are of letters, digits, '_', '-' and '.', because folders are named so")
        yield name, each


def _place(name: str, field: StudyField) -> Place:
    given = field.table(("map", "reference"))
    if len(given) != 1:
        field.refuse("needs either map, which is ready, or reference, a folder of photographs to make one of")
    return Place(name, *(given[key].place() if key in given else None for key in ("map", "reference")))


def _subject(name: str, field: StudyField, places: Mapping[str, Place]) -> Subject:
    given = field.table(("body", "rig", "range_of_motion", "place"))
    if ("body" in given) == ("range_of_motion" in given):
        field.refuse("needs either body, which is ready, or range_of_motion, a recording to make one of")
    rig = given["rig"].place() if "rig" in given else None
    if "body" in given:
        return Subject(name, given["body"].place(), rig, None, None)
    if rig is None:
        field.refuse("lacks rig, which says on which segment each camera is: without it no body can be made")
    source = _source(given["range_of_motion"], name)
    return Subject(name, None, rig, source, _of_names(field, given.get("place"), places, "place"))


def _source(field: StudyField, name: str) -> Source:
    path = field.place()
    if (found := source_at(path)) is None:
        field.refuse(f"{path} is neither a ros2 bag nor a folder of videos")
    return Source(name, path, found.is_bag)


def _recordings(
    field: StudyField, subjects: Mapping[str, Subject], places: Mapping[str, Place], equipment: Path | str | None
) -> Iterator[Recording]:
    given = field.table(_OF_RECORDING, needed=("path",))
    subject = _of_names(field, given.get("subject"), subjects, "subject")
    place = _of_names(field, given.get("place"), places, "place")
    own = _equipment(given["equipment"]) if "equipment" in given else equipment
    name = given["name"].name() if "name" in given else None
    for source in recordings_at(given["path"], name):
        truth = _truth(given["truth"], source) if "truth" in given else None
        yield Recording(source, subject, place, truth, own)


def _truth(field: StudyField, source: Source) -> Path:
    """What a recording is measured against; ``{name}`` and ``{path}`` in it are the recording's."""
    text = field.text().replace("{name}", source.name).replace("{path}", str(source.path.absolute()))
    return StudyField(field.file, field.key, text).place()


def _of_names(field: StudyField, given: StudyField | None, known: Mapping[str, Any], what: str) -> str:
    """One of the study's places or subjects, which need not be said where there is one only."""
    if given is not None:
        return given.one_of(known, f"{what} of this study")
    if len(known) != 1:
        field.refuse(f"lacks {what}; there are {', '.join(known)}")
    return next(iter(known))


def _equipment(field: StudyField | None) -> Path | str | None:
    """A file, or the name of what is supplied."""
    from bodycam_ros.body.equipment_yaml import equipment_path, supplied_equipment

    if field is None:
        return None
    if field.text() in supplied_equipment():
        return field.text()
    try:
        equipment_path(field.text())
    except BodyError as error:
        field.refuse(str(error))
    return field.place()


def _settings(field: StudyField | None) -> Path | Mapping[str, Any] | None:
    """A parameter file, or a table of groups, of which every setting is checked."""
    from bodycam_ros.all_settings import all_groups
    from bodycam_ros.settings import read_settings_file, settings_from_mapping

    if field is None:
        return None
    settings = field.place() if isinstance(field.value, str) else None
    try:
        table = field.value if settings is None else read_settings_file(settings)
        source = f"{field.file}: {field.key}" if settings is None else str(settings)
        checked = StudyField(field.file if settings is None else settings, field.key, table)
        known = all_groups()
        for group, values in checked.named():
            values.refuse("is no group of settings") if group not in known else None
            settings_from_mapping(known[group], {n: f.value for n, f in values.named()}, f"{source}: {group}")
    except SettingsError as error:
        raise StudyError(str(error)) from error
    return settings if settings is not None else field.value


def _exports(field: StudyField | None) -> tuple[str, ...]:
    from bodycam_ros.formats.formats import FORMATS

    if field is None:
        return ()
    return tuple(dict.fromkeys(each.one_of(FORMATS, "format of 'bodycam export'") for each in field.listed()))


def _resources(field: StudyField | None) -> Mapping[str, StageResources]:
    if field is None:
        return {}
    found = {}
    for stage, each in field.table(STAGES).items():
        given = each.table(("threads", "memory_mb"))
        found[stage] = StageResources(
            given["threads"].number(_MOST_THREADS) if "threads" in given else None,
            given["memory_mb"].number(_MOST_MEMORY_MB) if "memory_mb" in given else None,
        )
    return found
