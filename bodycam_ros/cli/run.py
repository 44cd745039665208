"""bodycam run: all steps for a folder of recordings; steps that are done are left alone."""

import argparse
from pathlib import Path

from bodycam_ros.cli.options import add_config, add_option
from bodycam_ros.cli.study import solve_study
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.study.study_file import LAYOUT, SOLVED, list_missing, read_recording_folder

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
    study = read_recording_folder(arguments.folder)
    solved = solve_study(study, arguments.folder / SOLVED, arguments, is_logged=False)
    terminal, missing = Terminal(), list_missing(study)
    for lack in missing:
        terminal.print(f"missing in {arguments.folder}: {lack}", style="red")
    if missing or solved.failures:
        return 1
    for step in solved.graph.steps if not arguments.dry_run else ():
        if step.stage == "evaluate":
            terminal.print(f"{step.name.partition(':')[0]}: {step.output / 'summary.png'}")
    return 0 if arguments.dry_run else solved.exit_code
