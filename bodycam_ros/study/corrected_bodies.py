"""Keeps what somebody corrected by hand: Snakemake would replace a body whose range of motion has changed, whatever it
is by then, and with it an afternoon in ``bodycam view``.
"""

import re
from collections.abc import Collection
from pathlib import Path

from bodycam_ros.errors import OutputError, StudyError
from bodycam_ros.study.steps import DoneSteps, Source, Step, source_at, state_of
from bodycam_ros.study.study import StudySteps
from bodycam_ros.study.study_field import StudyField
from bodycam_ros.study.workflow_folder import LOCK

_NOTES = "steps"


class CorrectedBodies:
    """Notes of maps and bodies, and of the bags they are made of, as they were made.

    Args:
        folder: of the study.
    """

    def __init__(self, folder: Path) -> None:
        self._done = DoneSteps(folder / _NOTES)

    def note(self, step: Step) -> None:
        """Remember what a step has just made, if it is one of those."""
        if step.stage in ("map", "ingest", "body") and step.output.exists():
            self._done.note(step, state_of(step), 0)

    def check(self, steps: StudySteps) -> None:
        """Refuse to make anew what was corrected.

        Raises:
            StudyError: somebody has changed by hand what must be made again; the message says what to do.
        """
        made: set[Path] = set()
        for shared in (*steps.of_places.values(), *steps.of_subjects.values()):
            for step in shared:
                try:
                    is_done = self._done.exit_code(step, anew=bool(made & set(step.inputs))) is not None
                except OutputError as error:
                    raise _refusal(step, "what it was made of has changed, too") from error
                if not is_done:
                    made.add(step.output)

    def changed(self, steps: StudySteps) -> list[Step]:
        """Those whose results somebody has changed by hand."""
        return [step for step in steps if self._done.is_changed(step)]

    def check_planned(self, steps: StudySteps, planned: Collection[str]) -> None:
        """The same where it is known what Snakemake would do: to it a file is another whenever it is newer, say.

        Args:
            steps: all of them.
            planned: names of those that would be done.

        Raises:
            StudyError: what was corrected would be made anew.
        """
        for step in self.changed(steps):
            if step.name in planned:
                raise _refusal(step, "would be made anew")


def _refusal(step: Step, why: str) -> StudyError:
    return StudyError(
        f"{step.output}: was changed by hand, and {why}; to keep it, move it and say in the study file where it is "
        "(map of a place, body of a subject), or remove it to have it made anew"
    )


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
