"""What 'bodycam evaluate' is told of another system, and what it prints of it."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from bodycam_ros.errors import RecordingError

if TYPE_CHECKING:
    from bodycam_ros.evaluate.agree import AgreementOptions
    from bodycam_ros.evaluate.evaluation import Evaluation

_ALIGNMENTS = ("similarity", "rigid", "none")
_FOUND, _SHARED = "found", "shared"
_SPREAD = ("mean", "median", "sd", "min", "max")


def add_agreement_flags(parser: argparse.ArgumentParser) -> None:
    """Add what is asked of the truth."""
    parser.add_argument(
        "--align",
        choices=_ALIGNMENTS,
        help="with --truth: how worlds are aligned (default: similarity, as in the paper; the report says its scale)",
    )
    parser.add_argument(
        "--clock",
        choices=(_FOUND, _SHARED),
        help="with --truth: whether its stamps are of our clock, or offset and rate are found by the motion (default: "
        "shared for a recording's truth, found for another system)",
    )
    parser.add_argument(
        "--names",
        type=Path,
        metavar="MAP.YAML",
        help="with --truth: which of our segments, joints or cameras its points are, where their names do not tell: "
        "'RKNE: thigh_right', or '{segment: thigh_right, at: [x, y, z]}' in mm, or 'at: fitted', or null",
    )


def check_agreement_flags(arguments: argparse.Namespace) -> None:
    """Refuse what is said of no truth.

    Raises:
        RecordingError: so it is.
    """
    for flag in ("align", "clock", "names"):
        if arguments.truth is None and getattr(arguments, flag) is not None:
            raise RecordingError(f"--{flag} is about what OUT is compared with: give that with --truth")


def agreement_options(arguments: argparse.Namespace) -> "AgreementOptions | None":
    """How to compare; None without a truth."""
    from bodycam_ros.evaluate.agree import AgreementOptions
    from bodycam_ros.formats.read_captured import is_captured

    if arguments.truth is None:
        return None
    clock = arguments.clock or (_FOUND if is_captured(arguments.truth) else _SHARED)
    return AgreementOptions(arguments.align or _ALIGNMENTS[0], clock == _SHARED, arguments.names)


def agreement_table(agreement: Mapping[str, Any]) -> Table:
    """Errors as the paper states them, overall and per joint; the report has those per plane."""
    table = Table(title=f"against {agreement['with']}", caption="per joint and plane, with pictures, in report.html")
    table.add_column("error")
    for column in _SPREAD:
        table.add_column(column, justify="right")
    rows = {"joint position [cm]": agreement["position_cm"], "joint angle [deg]": agreement["angle_deg"]}
    rows |= {f"{name} [cm]": point["position_cm"] for name, point in agreement["points"].items()}
    for name, spread in rows.items():
        if spread is not None:
            table.add_row(name, *("" if spread[of] is None else f"{spread[of]:.2f}" for of in _SPREAD))
    return table


def agreement_remarks(evaluation: "Evaluation") -> list[str]:
    """How the two were brought together; nothing of a recording's own truth, which needs no such words."""
    from bodycam_ros.evaluate.agreement_section import agreement_lines

    agreement = evaluation.agreement
    if agreement is None or (evaluation.comparison is not None and agreement.clock.start_sigma_s == 0.0):
        return []
    return agreement_lines(agreement)
