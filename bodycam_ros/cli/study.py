"""bodycam study: all steps for many recordings, as a Snakemake workflow; what is done is left alone."""

import argparse
import os
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from bodycam_ros.cli.settings_flags import positive
from bodycam_ros.terminal import Terminal, widened

if TYPE_CHECKING:
    from bodycam_ros.study.corrected_bodies import CorrectedBodies
    from bodycam_ros.study.snakemake_process import SnakemakeProcess
    from bodycam_ros.study.study import StudySteps
    from bodycam_ros.study.study_report import RecordingResult
    from bodycam_ros.study.workflow_folder import WorkflowFolder

_END = """
STUDY.yaml says who was recorded where, as docs/study.md describes. The commands of
each step, in DIR/steps.json, are those that 'bodycam run' takes for one folder;
DIR/Snakefile runs them, also without this command. It may be interrupted, and goes
on where it was. A step is done again where its command, a setting, this software
or what it reads has changed. A recording that fails is named, the others go on.

DIR/study.html is the page to look at first; DIR/logs says what each step said.

Exit code: 0 if all is done, 3 if a result should not be used, 1 if a recording
failed, 128 + the number of the signal that ended it.
"""

_WRONG_RESULT = 3
_STYLES = {"good": "green", "doubtful": "yellow", "wrong": "bold red", "failed": "bold red", "not done": "red"}


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "study", description=__doc__, epilog=_END, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path, metavar="STUDY.YAML", help="which recordings, of whom, where")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder for all that is made (default: STUDY, beside the file)"
    )
    parser.add_argument("--cores", type=positive, default=os.cpu_count() or 1, help="to be used (default: all)")
    parser.add_argument(
        "--profile",
        metavar="slurm|DIR",
        help="run the steps on a cluster: slurm writes DIR/profiles/slurm/config.yaml, to be completed by partition "
        "and account; or a folder with a Snakemake profile",
    )
    parser.add_argument("--dry-run", action="store_true", help="only say which steps would be taken")
    parser.add_argument("--report-only", action="store_true", help="only write the page of what is done by now")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.study.corrected_bodies import CorrectedBodies
    from bodycam_ros.study.job_resources import JobResources
    from bodycam_ros.study.snakemake_process import SnakemakeProcess, check_snakemake, profile_folder
    from bodycam_ros.study.study import study_steps
    from bodycam_ros.study.study_file import read_study
    from bodycam_ros.study.workflow_folder import WorkflowFolder, folder_of, stages_of, study_lock

    study = read_study(arguments.study)
    folder = WorkflowFolder.at(arguments.output or folder_of(arguments.study), study)
    steps = study_steps(study, folder.path)
    if arguments.report_only:
        return _report(folder, steps)
    check_snakemake("snakemake_executor_plugin_slurm" if arguments.profile == "slurm" else None)
    if arguments.profile is None:
        resources = JobResources.on_this_machine(arguments.cores, stages_of(steps), study.resources)
        words = ["--cores", str(arguments.cores), "--resources", f"mem_mb={resources.limit_mb}"]
    else:
        resources = JobResources.on_a_cluster(study.resources)
        words = ["--profile", str(profile_folder(arguments.profile, folder.path))]
    folder.path.mkdir(parents=True, exist_ok=True)
    with study_lock(folder.path) as lock:
        folder.write(steps, resources)
        process = SnakemakeProcess(folder.path, words, lock.descriptor)
        if lock.is_left:
            process.unlock()
            Terminal(stderr=True).print(f"{folder.path}: unlocked, because a run before was killed", style="yellow")
        bodies = CorrectedBodies(folder.path)
        bodies.check(steps)
        if arguments.dry_run:
            return _tell_plan(process)
        if bodies.changed(steps):
            bodies.check_planned(steps, _plan(process))
        _run(process, folder, steps, bodies)
    return _report(folder, steps)


def _plan(process: "SnakemakeProcess") -> list[str]:
    """Names of the steps that would be taken."""
    with closing(process.run(dry=True)) as all_news:
        return [news.name for news in all_news]


def _tell_plan(process: "SnakemakeProcess") -> int:
    """Say what would be done."""
    planned = _plan(process)
    for name in planned:
        Terminal().print(name, soft_wrap=True)
    Terminal().print(f"{len(planned)} steps would be taken" if planned else "everything is done")
    return 0


def _run(process: "SnakemakeProcess", folder: "WorkflowFolder", steps: "StudySteps", bodies: "CorrectedBodies") -> None:
    """Run it, with a line a job that has ended."""
    from bodycam_ros.study.study_report import failure_of

    by_name = {step.name: step for step in steps}
    begun: dict[str, float] = {}
    terminal = Terminal(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with (
        Progress(*columns, console=terminal, transient=True, disable=not terminal.is_terminal) as bars,
        closing(process.run()) as all_news,
    ):
        task = bars.add_task("steps", total=len(by_name))
        for news in all_news:
            step, now = by_name[news.name], time.monotonic()
            if news.state == "begun":
                begun[news.name] = now
                bars.update(task, total=process.jobs)
                continue
            if news.state == "done":
                bodies.note(step)
                line, style = f"done in {now - begun[news.name]:.0f} s", "green"
            else:
                line, style = f"FAILED: {failure_of(folder, step)}", "bold red"
            terminal.print(f"{news.name}: {line}", style=style, soft_wrap=True)
            bars.advance(task)


def _report(folder: "WorkflowFolder", steps: "StudySteps") -> int:
    """Write the page and print its table."""
    from bodycam_ros.study.study_report import PAGE, counted, results_of, told_failure, write_study_report

    results = results_of(folder.study, folder, steps)
    write_study_report(folder.study.path.stem, results, folder.path)
    terminal = widened(Terminal())
    terminal.print(_table(results))
    for result in results:
        if result.failed is not None:
            step, why = told_failure(result)
            terminal.print(f"{result.recording.name}: {step}: {why}", style="red", soft_wrap=True)
    terminal.print(f"{counted(results)}; written to {folder.path / PAGE}", soft_wrap=True)
    if any(result.failed is not None for result in results):
        return 1
    return _WRONG_RESULT if any(result.verdict == "wrong" for result in results) else 0


def _table(results: "Sequence[RecordingResult]") -> Table:
    from bodycam_ros.study.study_report import shown_columns

    columns = shown_columns(results)
    table = Table("recording", "subject", "place", "verdict", *(column.heading for column in columns))
    for result in results:
        cells = (result.recording.name, result.recording.subject, result.recording.place, result.verdict)
        table.add_row(*cells, *(column.cell(result) for column in columns), style=_STYLES.get(result.verdict))
    return table
