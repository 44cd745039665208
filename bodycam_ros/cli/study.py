"""bodycam study: all steps for many recordings, on all cores; steps that are done are left alone."""

import argparse
import shlex
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from bodycam_ros.cli.options import add_config, add_option
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.results.verdict import WRONG_RESULT
from bodycam_ros.study.done_steps import DoneSteps
from bodycam_ros.study.step_runner import StepEnd, StepRunner, study_lock
from bodycam_ros.study.study import Step, Study, study_steps
from bodycam_ros.study.study_file import check_results_folder, read_study

EPILOG = """
STUDY.yaml lists who was recorded where, as docs/study.md describes. The commands
are those of 'bodycam run'; --dry-run prints them, for example for a cluster. A
study may be interrupted, and continues where it was. A step runs again where its command, a
setting, this software or an input has changed. A recording that fails is named,
the others go on.

DIR/study.html is the page to look at first; DIR/logs has what each step printed.

Exit code: 0 if all is done, 3 if a result should not be used, 1 if a recording
failed, 128 + the number of the signal that ended it.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "study", type=Path, metavar="STUDY.YAML", help="YAML file with the recordings, people and places"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder for all results (default: STUDY, beside the file)"
    )
    parser.add_argument("--dry-run", action="store_true", help="only print the commands of the steps that would run")
    add_option(parser, "--jobs", help="processes at a time (default: all cores)")
    add_config(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    path: Path = arguments.study
    study = read_study(path)
    beside = path.with_suffix("") if path.suffix else path.with_name(f"{path.name}_study")
    folder = check_results_folder(arguments.output or beside, study)
    solved = solve_study(study, folder, arguments, logs=folder / "logs")
    if arguments.dry_run:
        return 0
    from bodycam_ros.study.study_report import PAGE, count_verdicts, read_results, write_study_report

    results = read_results(study, solved.steps, solved.notes, solved.failures)
    write_study_report(path.stem, results, folder)
    terminal = Terminal()
    for result in results:
        if result.failure is not None:
            failure = result.failure
            terminal.print(f"{result.recording.name}: {failure.step.name}: {failure.failure}", style="red")
    terminal.print(f"{count_verdicts(results)}; written to {folder / PAGE}")
    return solved.exit_code


@dataclass(frozen=True)
class SolvedStudy:
    """What became of a study.

    Attributes:
        steps: all of them.
        notes: of the steps that are done.
        failures: name -> end of those that failed.
    """

    steps: Sequence[Step]
    notes: DoneSteps
    failures: Mapping[str, StepEnd]

    @property
    def exit_code(self) -> int:
        """0, 3 if a result should not be used, 1 if a step failed."""
        if self.failures:
            return 1
        return WRONG_RESULT if any(self.notes.exit_code(step) == WRONG_RESULT for step in self.steps) else 0


def solve_study(study: Study, folder: Path, arguments: argparse.Namespace, logs: Path | None) -> SolvedStudy:
    """Run the steps of a study that are not done, with a line for each.

    Args:
        study: what to solve; --config replaces its settings.
        folder: of the results.
        arguments: of the command.
        logs: folder for what the steps print; without it they print to the terminal, one after another.
    """
    steps = study_steps(replace(study, settings=arguments.config or study.settings), folder)
    notes, terminal = DoneSteps(folder / "steps"), Terminal()
    planned = notes.steps_to_run(steps)
    for step in steps:
        if step not in planned:
            terminal.print(f"{step.name}: is done", style="green")
        elif arguments.dry_run:
            terminal.print(f"{step.name}: bodycam {shlex.join(step.words)}")
    failures: dict[str, StepEnd] = {}
    if arguments.dry_run or not planned:
        return SolvedStudy(steps, notes, failures)
    with (
        study_lock(folder) as lock,
        shown_progress(hidden=logs is None) as progress,
        progress.step("steps", len(planned)) as advance,
        closing(StepRunner(notes, arguments.jobs, logs, lock).run(planned)) as events,
    ):
        for event in events:
            if isinstance(event, Step):
                if logs is None:
                    terminal.print(f"{event.name}: bodycam {shlex.join(event.words)}", style="bold")
                continue
            advance()
            if event.failure is None:
                terminal.print(f"{event.step.name}: done in {event.seconds:.0f} s", style="green")
            else:
                failures[event.step.name] = event
                terminal.print(f"{event.step.name}: FAILED: {event.failure}", style="bold red")
    return SolvedStudy(steps, notes, failures)
