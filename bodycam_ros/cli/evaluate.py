"""bodycam evaluate: how good is a solved recording, on its own or against the truth; exit code 3 if it is wrong."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from bodycam_ros.cli.agreement_flags import (
    add_agreement_flags,
    agreement_options,
    agreement_remarks,
    agreement_table,
    check_agreement_flags,
)
from bodycam_ros.cli.outside_pictures import add_outside_flags, outside_files, outside_pictures
from bodycam_ros.cli.progress import shown_progress, waiting
from bodycam_ros.cli.tables import (
    body_table,
    camera_styles,
    camera_table,
    clock_table,
    constraint_table,
    equipment_tables,
    exit_code,
    gait_table,
    joint_table,
    print_verdict,
    sliding_table,
    station_table,
    truth_table,
)
from bodycam_ros.terminal import Terminal, widened

if TYPE_CHECKING:
    from bodycam_ros.evaluate.evaluation import Evaluation
    from bodycam_ros.verdict import Verdict


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("evaluate", description=__doc__)
    parser.add_argument("solved", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote")
    parser.add_argument(
        "--truth",
        type=Path,
        metavar="X",
        help="folder of a recording with ground truth, or what another system captured: .trc, .c3d, .bvh, .tum, or a "
        "folder of .tum",
    )
    add_agreement_flags(parser)
    parser.add_argument(
        "--recording",
        type=Path,
        metavar="BAG",
        help="bag that OUT was solved from: adds reprojection errors and overlay.png",
    )
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="OUT2",
        help="the same recording solved without the equipment: distances from what holds, and with --stations "
        "close-ups, with the constraints and without",
    )
    add_outside_flags(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for report.html, report.md, summary.json and their pictures",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # matplotlib takes half a second to load; the other commands and --help do without.
    from bodycam_ros.evaluate.close_ups import close_ups
    from bodycam_ros.evaluate.evaluation import evaluate
    from bodycam_ros.evaluate.overlay_picture import overlay_views
    from bodycam_ros.evaluate.report_folder import check_report_folder, write_report
    from bodycam_ros.output_place import check_output

    outside = outside_files(arguments)
    check_agreement_flags(arguments)
    check_report_folder(arguments.output)
    inputs = (arguments.solved, arguments.truth, arguments.recording, arguments.compare)
    check_output(arguments.output, (*inputs, arguments.stations, arguments.surface, arguments.map, arguments.names))
    _check_earlier(arguments.output)
    with waiting("reading and measuring"):
        evaluation = evaluate(
            arguments.solved,
            arguments.truth,
            arguments.recording,
            agreement_options(arguments),
            arguments.compare,
        )
    with waiting("looking at images"):
        overlay = overlay_views(evaluation.solved, arguments.recording) if arguments.recording is not None else ()
    if outside is None:
        with waiting("drawing"):
            write_report(evaluation, arguments.output, overlay)
    else:
        with shown_progress() as progress:
            more = outside_pictures(evaluation, arguments.recording, outside, arguments.video, progress)
            shown = (
                ()
                if evaluation.constraints is None
                else close_ups(evaluation.constraints, arguments.recording, outside)
            )
            write_report(evaluation, arguments.output, overlay, more, shown)
    _report(evaluation, arguments.output)
    print_verdict(Terminal(), evaluation.verdict)
    if arguments.recording is not None:
        compare_lenses(evaluation.verdict, arguments.recording)
    return exit_code(evaluation.verdict)


def compare_lenses(verdict: "Verdict", recording: Path) -> None:
    """Say which of the cameras that contradict the body were recorded with another lens: some seconds each."""
    from bodycam_ros.lens.recorded_lens import other_lenses

    accused = {finding.camera for finding in verdict.findings if finding.part == "camera"}
    with waiting("comparing lenses"):
        remarks = [match.text for match in other_lenses(recording, sorted(accused))]
    for remark in remarks:
        Terminal().print(remark, style="red", soft_wrap=True)


def _check_earlier(folder: Path) -> None:
    """Refuse to replace pictures of these names that no evaluation made: it writes figures along with each.

    Raises:
        OutputError: there are such.
    """
    from bodycam_ros.evaluate.report_folder import FIGURES, WRITTEN
    from bodycam_ros.output_place import check_file

    check_file(folder / FIGURES, force=True, mark=b'"image_coverage"', what="summary of 'bodycam evaluate'")
    if not (folder / FIGURES).exists():
        for name in WRITTEN:
            check_file(folder / name, force=False, mark=b"", what="part of a report")


def _report(evaluation: "Evaluation", folder: Path) -> None:
    from bodycam_ros.evaluate.summary import summary

    figures = summary(evaluation)
    console = widened(Terminal())  # units stand in square brackets
    if figures["cameras"]:
        console.print(camera_table(figures["cameras"], camera_styles(evaluation.verdict)))
    if "stations" in figures:
        console.print(station_table(figures["stations"]))
    if any("clock" in camera for camera in figures["cameras"].values()):
        console.print(clock_table(figures["cameras"]))
    console.print(body_table(figures))
    if "equipment" in figures:
        for table in equipment_tables(figures["equipment"]):
            console.print(table)
    if figures["sliding"].get("all", {"stances": 0})["stances"]:
        console.print(sliding_table(figures))
    if "truth" in figures:
        console.print(joint_table(figures["truth"]))
        console.print(truth_table(figures["truth"]))
    if "agreement" in figures and "truth" not in figures:
        console.print(agreement_table(figures["agreement"]))
    if "constraints" in figures:
        console.print(constraint_table(figures["constraints"]))
    if evaluation.gait is not None:
        console.print(gait_table(evaluation.gait, evaluation.true_gait))
    for line in (*_remarks(figures), *agreement_remarks(evaluation), f"written to {folder}"):
        console.print(line, soft_wrap=True)
    for doubt in () if evaluation.agreement is None else evaluation.agreement.doubts:
        console.print(Text(f"doubtful: {doubt}", "yellow"), soft_wrap=True)


def _by_motion(classes: Sequence[Mapping[str, Any]]) -> str:
    """The registered share of each class of image motion; an end that is unknown has no end."""
    spans = [f"{c['low_px']:g}" + ("+" if c["high_px"] is None else f" to {c['high_px']:g}") for c in classes]
    return ", ".join(f"{span}: {c['registered']:.1%}" for span, c in zip(spans, classes, strict=True))


def _sliding_remarks(figures: Mapping[str, Any]) -> list[str]:
    sliding = figures["sliding"].get("all", {"stances": 0})
    if not sliding["stances"]:
        return []
    beyond = figures.get("sliding_against_truth", {}).get("all", {"beyond": {"stances": 0}})["beyond"]
    against = f"; {beyond['mean_mm']:.2f} mm beyond the true ones" if beyond["stances"] else ""
    return [
        f"standing feet slide by {sliding['mean_mm']:.2f} mm on average, {sliding['max_mm']:.1f} mm at most, in "
        f"{sliding['stances']} stances of heel or ball{against}"
    ]


def _remarks(figures: Mapping[str, Any]) -> list[str]:
    remarks = [
        f"{figures['instants']} instants in {figures['duration_s']:.2f} s, {figures['image_coverage']:.1%} of the "
        f"images covered; {figures['instants_without_camera']} instants without any camera"
    ]
    if figures["blur"]:
        remarks.append(f"registered at a motion of {_by_motion(figures['blur'])} px per image")
    remarks += [f"not solved: {start:.2f} to {end:.2f} s" for start, end in figures["gaps_s"]]
    remarks += _sliding_remarks(figures)
    if "truth" in figures:
        truth = figures["truth"]
        remarks.append(
            f"truth: coverage {truth['coverage']:.1%}, scale {truth['scale']:.5f}, tilt {truth['tilt_deg']:.3f} deg"
        )
        if truth["links_missing"]:
            remarks.append(f"in the truth, but not in the body: {', '.join(truth['links_missing'])}")
    return remarks
