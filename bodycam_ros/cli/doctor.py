"""bodycam doctor: check a recording before you solve it and before the cameras come off; this takes seconds."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import fields

from rich.table import Table
from rich.text import Text
from threadpoolctl import threadpool_limits

from bodycam_ros.cli.options import add_option, add_span, add_topics, given_span, topic_names
from bodycam_ros.cli.output import STYLES, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.quality.doctor import DoctorInput, examine, skipped_checks
from bodycam_ros.results.verdict import WRONG_RESULT, Finding, Level, finding_record, worst_level

EPILOG = (
    "Exit code: 0 if nothing is wrong, 3 if something is wrong (correct it and record again), 1 if a file cannot be "
    "used. Only some images are checked: a recording that is good here may still fail, one that is wrong will fail."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    recording_help = (
        "ros2 bag folder or .mcap file, a video, or a folder with videos or images, or with a folder for each camera"
    )
    add_option(parser, "recording", metavar="RECORDING", help=recording_help)
    add_option(parser, "--map")
    add_option(parser, "--body", help="body YAML; checks that all its cameras are in the recording")
    add_option(
        parser,
        "--rig",
        help="rig YAML; checks that all its cameras are in the recording. With --map the recording must be a range of "
        "motion, and the exercise of every joint is checked, and whether cameras are exchanged (not in videos, "
        "of which only a few images are checked: 'bodycam body' does it)",
    )
    add_option(
        parser,
        "--board",
        help="description of the AprilTag board; checks that it is in view (default: board.yaml beside RECORDING)",
    )
    add_option(parser, "--lenses")
    add_option(parser, "--rate")
    add_option(parser, "--imu")
    add_topics(parser)
    add_span(parser)
    parser.add_argument("--json", action="store_true", help="print the findings as JSON, for scripts")
    add_option(parser, "--jobs", help="threads (default: all cores)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    names = [each.name for each in fields(DoctorInput) if each.name not in ("names", "span")]
    values = {name: getattr(arguments, name) for name in names}
    given = DoctorInput(**values, names=topic_names(arguments), span=given_span(arguments))
    # The matrices are many and small: threads of the linear algebra would take more time to wait than to compute.
    with shown_progress() as progress, threadpool_limits(1, user_api="blas"):
        findings = examine(given, arguments.jobs, progress)
    level = worst_level(findings)
    if arguments.json:
        print(json.dumps({"level": level.word, "findings": [*map(finding_record, findings)]}, indent=1))
    else:
        _print(findings)
        for check in skipped_checks(given, findings):
            Terminal().print(f"not checked: {check}")
        verdict = {
            Level.GOOD: "good: no problem was found",
            Level.DOUBTFUL: "doubtful: the recording can be used; the changes above would make it better",
            Level.WRONG: "wrong: correct what is marked as wrong above, then record again",
        }[level]
        Terminal().print(Text(verdict, STYLES[level]))
    return WRONG_RESULT if level is Level.WRONG else 0


def _print(findings: Sequence[Finding]) -> None:
    """A line or more per check: what is wrong, or that nothing is."""
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    for check in dict.fromkeys(finding.check for finding in findings):
        of_check = [finding for finding in findings if finding.check == check]
        for level in sorted({finding.level for finding in of_check}, reverse=True):
            # A check ends with its summary, which is good.
            texts = [finding.text for finding in (of_check if level else of_check[-1:]) if finding.level is level]
            for text in merge_lines(texts):
                table.add_row(check, Text(level.word, STYLES[level]), Text(text))
    Terminal().print(table)
