"""bodycam study: all steps for many recordings, on all cores; steps that are done are left alone."""

import argparse
import os
import shlex
from collections.abc import Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from bodycam_ros.cli.options import add_config, add_option
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.results.verdict import WRONG_RESULT
from bodycam_ros.settings import read_settings_file
from bodycam_ros.study.engine import Engine, StepEnd
from bodycam_ros.study.step_graph import StepGraph
from bodycam_ros.study.step_needs import StepNeeds
from bodycam_ros.study.study import Step, Study, study_steps
from bodycam_ros.study.study_file import check_results_folder, read_study
from bodycam_ros.study.study_lock import study_lock

EPILOG = """
STUDY.yaml lists who was recorded where, as docs/study.md describes. The commands
are those of 'bodycam run'; --dry-run prints them. A study may be interrupted, and
continues where it was. A step runs again where its command, a setting, this
software or an input has changed. A recording that fails is named, the others go on.

The engine is Snakemake. --profile slurm sends the steps to a Slurm cluster, each
with the memory, processors and time that such steps took, and twice as much when
it is tried again. Other clusters and clouds have profiles of Snakemake.

DIR/study.html is the page to look at first; DIR/logs has what each step printed.

Exit code: 0 if all is done, 3 if a result should not be used, 1 if a recording
failed, 128 + the number of the signal that ended it.
"""


_CLUSTER_PROCESSES = 8  # a replay's own process is the limit with more (docs/benchmarks.md)


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
    add_option(
        parser,
        "--jobs",
        default=None,
        help="processes at a time (default: all cores); with --profile those of one step (default: 8)",
    )
    parser.add_argument(
        "--profile", help="send the steps to a cluster: slurm, or a Snakemake profile of yours, by its name or folder"
    )
    add_config(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    path: Path = arguments.study
    study = read_study(path)
    beside = path.with_suffix("") if path.suffix else path.with_name(f"{path.name}_study")
    folder = check_results_folder(arguments.output or beside, study)
    solved = solve_study(study, folder, arguments, is_logged=True, profile=arguments.profile)
    if arguments.dry_run:
        return 0
    from bodycam_ros.study.study_report import PAGE, count_verdicts, read_results, write_study_report

    results = read_results(study, solved.graph, solved.failures)
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
        graph: of all steps.
        failures: name -> end of those that failed.
    """

    graph: StepGraph
    failures: Mapping[str, StepEnd]

    @property
    def exit_code(self) -> int:
        """0, 3 if a result should not be used, 1 if a step failed."""
        if self.failures:
            return 1
        codes = map(self.graph.exit_code, self.graph.steps)
        return WRONG_RESULT if WRONG_RESULT in codes else 0


def solve_study(
    study: Study, folder: Path, arguments: argparse.Namespace, is_logged: bool, profile: str | None = None
) -> SolvedStudy:
    """Run the steps of a study that are not done, with a line for each.

    Args:
        study: what to solve; --config replaces its settings.
        folder: of the results.
        arguments: of the command.
        is_logged: what the steps print goes to files, and they share the cores; else they print to the terminal, one
            after another.
        profile: of a cluster.

    Raises:
        SettingsError: the file of --config cannot be read.
        StudyError: another run is at work, or Snakemake cannot run.
    """
    if arguments.config is not None:
        read_settings_file(arguments.config)  # so that what is wrong with it is named before anything runs
    steps = study_steps(replace(study, settings=arguments.config or study.settings), folder)
    graph, terminal = StepGraph(steps, Path(os.path.realpath(folder)), is_logged), Terminal()
    cores = arguments.jobs or os.cpu_count() or 1
    if profile is not None:
        processes = arguments.jobs or _CLUSTER_PROCESSES
    else:
        # A process is waited for by its own threads, not by others, so recordings share the cores.
        processes = max(1, cores // max(1, len(study.recordings))) if is_logged else cores
    engine = Engine(graph, StepNeeds(steps, processes, alone=not is_logged), cores, profile)
    with nullcontext() if arguments.dry_run else study_lock(folder) as lock:  # another run changes what has to run
        planned = engine.steps_to_run()
        for step in steps:
            if step not in planned:
                terminal.print(f"{step.name}: is done", style="green")
            elif lock is None:
                terminal.print(f"{step.name}: bodycam {shlex.join(step.words)}")
        return SolvedStudy(graph, _run_steps(engine, planned, lock, terminal, is_logged) if lock and planned else {})


def _run_steps(
    engine: Engine, planned: Sequence[Step], lock: Path, terminal: Terminal, is_logged: bool
) -> dict[str, StepEnd]:
    """Run steps, with a line for each; the ends of those that failed, by name."""
    failures: dict[str, StepEnd] = {}
    with (
        shown_progress(hidden=not is_logged) as progress,
        progress.step("steps", len(planned)) as advance,
        closing(engine.run(planned, lock)) as events,
    ):
        for event in events:
            if isinstance(event, Step):
                if not is_logged:
                    terminal.print(f"{event.name}: bodycam {shlex.join(event.words)}", style="bold")
                continue
            is_first = event.step.name not in failures
            if event.failure is None:
                failures.pop(event.step.name, None)
                terminal.print(f"{event.step.name}: done in {event.seconds:.0f} s", style="green")
            else:
                failures[event.step.name] = event
                terminal.print(f"{event.step.name}: FAILED: {event.failure}", style="bold red")
            if is_first:  # not one that was tried again
                advance()
    return failures
