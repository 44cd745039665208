"""Recordings that a path or a pattern of a study file means, and what they are called."""

import re
from pathlib import Path

from bodycam_ros.study.study_field import StudyField
from bodycam_ros.study.study_lock import LOCK
from bodycam_ros.workflow.recording_folder import Source, source_at

_WILD = re.compile(r"[*?\[]")
_ODD = re.compile(r"[^\w.-]+|^\.")


def recordings_at(field: StudyField, name: str | None) -> list[Source]:
    """The recordings, in the order of their names.

    A recording that is named alone is called what its file or folder is. Of a pattern, all parts of the path from the
    first that fits a wildcard to the last make the name, joined by ``_``, and what no folder should be named becomes
    ``_``, too. What fits a pattern and is no recording, or was made by a study, is left out.

    Args:
        field: with the path or pattern.
        name: that the recording should have; of one only.

    Raises:
        StudyError: there is none, or the one that is named is no recording.
    """
    parts = Path(field.text()).parts
    wild = [at for at, part in enumerate(parts) if _WILD.search(part)]
    if not wild:
        path = field.place()
        if (found := source_at(path)) is None:
            field.refuse(f"{path} is neither a ros2 bag nor a folder of videos")
        return [Source(name or plain(found.name), path, found.is_bag)]
    if name is not None:
        field.refuse("name is of one recording; leave it out where path has wildcards")
    fixed = field.file.parent.joinpath(*parts[: wild[0]])
    beyond = len(parts) - 1 - wild[-1]
    sources = []
    for path in sorted(fixed.glob(str(Path(*parts[wild[0] :])))):
        if (found := source_at(path)) is not None and not _is_made(path, fixed):
            named = path.with_name(found.name).relative_to(fixed).parts
            sources.append(Source(plain("_".join(named[: len(named) - beyond])), path, found.is_bag))
    if not sources:
        field.refuse(f"no recording fits {field.file.parent.joinpath(*parts)}")
    return sources


def _is_made(path: Path, within: Path) -> bool:
    """Whether it lies in the folder of a study's results, or is one: the next run must not take it for a recording."""
    above = path.relative_to(within).parents
    return any((folder / LOCK).exists() for folder in (path, *(within / each for each in above)))


def plain(name: str) -> str:
    """A name that may be a folder's everywhere, and needs no quotes."""
    return _ODD.sub("_", name)
