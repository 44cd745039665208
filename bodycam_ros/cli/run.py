"""bodycam run: all steps for a folder of recordings; steps that are done are left alone."""

import argparse
from dataclasses import replace
from pathlib import Path

from bodycam_ros.cli.options import add_config, add_option
from bodycam_ros.cli.study import run_steps
from bodycam_ros.study.study_file import LAYOUT, SOLVED, list_missing, read_recording_folder
from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict import WRONG_RESULT

EPILOG = f"""
A RECORDING_DIR holds

{LAYOUT}
It runs the same commands that you could run by hand, and prints them. It may be
interrupted, and continues with the step it was at. A step runs again where its
command, a setting, or an input has changed. The picture of a take to look at is
solved/takes/NAME/report/summary.png.

Exit code: 0 if all is done, 3 if a result should not be used, 1 if a step failed
or something is missing, 128 + the number of the signal that ended it.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folder", type=Path, metavar="RECORDING_DIR", help="folder with the recordings, as below")
    parser.add_argument("--dry-run", action="store_true", help="only print the commands of the steps that would run")
    add_option(parser, "--jobs", help="processes and threads (default: all cores)")
    add_config(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.study.study import study_steps

    study = read_recording_folder(arguments.folder)
    study = replace(study, settings=arguments.config or study.settings)
    solved = arguments.folder / SOLVED
    steps = study_steps(study, solved)
    notes, failures = run_steps(steps, solved, arguments.jobs, arguments.dry_run, logs=None)
    terminal = Terminal()
    missing = list_missing(study)
    for lack in missing:
        terminal.print(f"missing in {arguments.folder}: {lack}", style="red")
    if failures or missing:
        return 1
    if arguments.dry_run:
        return 0
    for step in steps:
        if step.stage == "evaluate":
            terminal.print(f"{step.name.partition(':')[0]}: {step.output / 'summary.png'}")
    return WRONG_RESULT if any(notes.exit_code(step) == WRONG_RESULT for step in steps) else 0
