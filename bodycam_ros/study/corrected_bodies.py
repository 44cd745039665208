"""Keeps what somebody corrected by hand: Snakemake would replace a body whose range of motion has changed, whatever it
is by then, and with it an afternoon in ``bodycam view``.
"""

from collections.abc import Collection
from pathlib import Path

from bodycam_ros.errors import OutputError, StudyError
from bodycam_ros.study.study_steps import StudySteps
from bodycam_ros.workflow.done_steps import DoneSteps, state_of
from bodycam_ros.workflow.step import Step

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
