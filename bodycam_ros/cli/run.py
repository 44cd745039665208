"""bodycam run: all steps for a folder of recordings; what is done is left alone."""

import argparse
import shlex
from pathlib import Path

from bodycam_ros.cli.settings_flags import add_jobs
from bodycam_ros.shown import printable
from bodycam_ros.study.steps import LAYOUT, DoneSteps, RecordingFolder, Step, state_of, steps_of
from bodycam_ros.terminal import Terminal

_END = f"""
A RECORDING_DIR holds

{LAYOUT}
It runs the same commands that you could run by hand, and says which. It may be
interrupted, and goes on with the step it was at. A step is done again where its
command, a setting, or what it reads has changed. The picture of a take to look
at is solved/takes/NAME/report/summary.png.

Exit code: 0 if all is done, 3 if a result should not be used, 1 if a step failed
or something is missing, 128 + the number of the signal that ended it.
"""

_SIGNALLED = 128
_WRONG_RESULT = 3


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "run", description=__doc__, epilog=_END, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, metavar="RECORDING_DIR", help="folder with the recordings, as below")
    parser.add_argument("--dry-run", action="store_true", help="only say which steps would be taken")
    add_jobs(parser, "processes and threads")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    folder = RecordingFolder.look_into(arguments.folder)
    done = DoneSteps(folder.solved / "steps")
    terminal = Terminal()
    codes: list[int] = []
    made: set[Path] = set()
    failed: set[Path] = set()
    for step in steps_of(folder):
        if failed & set(step.inputs):
            terminal.print(f"{step.name}: not possible, because a step before it failed", style="red")
            failed.add(step.output)
            continue
        code = done.exit_code(step, anew=bool(made & set(step.inputs)))
        if code is not None:
            terminal.print(f"{step.name}: is done", style="green")
        else:
            made.add(step.output)
            terminal.print(printable(f"{step.name}: bodycam {shlex.join(step.words)}"), style="bold", soft_wrap=True)
            code = 0 if arguments.dry_run else _run(step, done, max(1, arguments.jobs))
        if code >= _SIGNALLED:
            return code
        if code not in (0, _WRONG_RESULT):
            failed.add(step.output)
        codes.append(code)
    for lack in folder.missing():
        terminal.print(f"missing in {folder.path}: {lack}", style="red", soft_wrap=True)
    if failed or folder.missing():
        return 1
    if not arguments.dry_run:
        for take in folder.takes:
            terminal.print(
                f"{take.name}: {folder.solved / 'takes' / take.name / 'report' / 'summary.png'}", soft_wrap=True
            )
    return _WRONG_RESULT if _WRONG_RESULT in codes else 0


def _run(step: Step, done: DoneSteps, jobs: int) -> int:
    """Run a step's command, as a person would, and note it if it came to its end."""
    from bodycam_ros.cli.main import main

    state = state_of(step)
    step.output.parent.mkdir(parents=True, exist_ok=True)
    code = main([*step.words, *(("--jobs", str(jobs)) if step.is_parallel else ())])
    if code in (0, _WRONG_RESULT):
        done.note(step, state, code)
    return code
