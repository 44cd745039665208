"""bodycam evaluate: how good is a solved recording, on its own or against the truth; exit code 3 if it is wrong."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from bodycam_ros.cli.options import add_map, add_output, add_stations, add_surface
from bodycam_ros.cli.progress import shown_progress, waiting
from bodycam_ros.cli.tables import exit_code, figure_tables, gait_table, print_verdict
from bodycam_ros.errors import RecordingError, StationError
from bodycam_ros.terminal import Terminal, widened

if TYPE_CHECKING:
    from bodycam_ros.evaluate.agree import AgreementOptions
    from bodycam_ros.evaluate.evaluation import Evaluation
    from bodycam_ros.evaluate.outside_picture import OutsideFiles
    from bodycam_ros.mapping.progress import Progress
    from bodycam_ros.verdict import Verdict

_ALIGNMENTS = ("similarity", "rigid", "none")
_FOUND, _SHARED = "found", "shared"


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("evaluate", description=__doc__)
    parser.add_argument("solved", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote")
    add_output(
        parser, "DIR", "folder for report.html, summary.json and their pictures", "pictures in DIR of other origin"
    )
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
        help="the same recording solved without the equipment: distances from constrained points, and with --stations "
        "close-ups of both",
    )
    truth = parser.add_argument_group("against the truth or another system")
    truth.add_argument(
        "--truth",
        type=Path,
        metavar="X",
        help="folder of a recording with ground truth, or what another system captured: .trc, .c3d, .bvh, .tum, or a "
        "folder of .tum",
    )
    truth.add_argument(
        "--align", choices=_ALIGNMENTS, help="how worlds are aligned (default: similarity, as in the paper)"
    )
    truth.add_argument(
        "--clock",
        choices=(_FOUND, _SHARED),
        help="whether its stamps are of our clock, or offset and rate are found by the motion (default: shared for a "
        "recording's truth, found for another system)",
    )
    truth.add_argument(
        "--points",
        type=Path,
        metavar="POINTS.YAML",
        help="its points as our segments, joints or cameras, where their names do not match: 'RKNE: thigh_right', or "
        "'{segment: thigh_right, at: [x, y, z]}' in mm, or 'at: fitted', or null",
    )
    static = parser.add_argument_group("static cameras")
    add_stations(
        static,
        "with --recording: where its static cameras are; adds outside.png, the body over their images, feet.png",
    )
    add_surface(static)
    add_map(static, required=False)
    static.add_argument(
        "--overlay-video",
        metavar="CAMERA",
        help="with --stations: adds outside.mp4, the body over its images",
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

    folder, recording = arguments.output, arguments.recording
    outside, options = _outside_files(arguments), _agreement_options(arguments)
    check_report_folder(folder)
    inputs = (arguments.solved, arguments.truth, recording, arguments.compare)
    check_output(folder, (*inputs, arguments.stations, arguments.surface, arguments.map, arguments.points))
    if not arguments.force:
        _check_earlier(folder)
    with waiting("reading and measuring"):
        evaluation = evaluate(arguments.solved, arguments.truth, recording, options, arguments.compare)
    with waiting("overlaying images"):
        overlay = overlay_views(evaluation.solved, recording) if recording is not None else ()
    if outside is None:
        with waiting("drawing"):
            write_report(evaluation, folder, overlay)
    else:
        with shown_progress() as progress:
            more = _outside_pictures(evaluation, recording, outside, arguments.overlay_video, progress)
            both = evaluation.constraints
            shown = () if both is None else close_ups(both, recording, outside)
            write_report(evaluation, folder, overlay, more, shown)
    _print(evaluation, folder)
    print_verdict(Terminal(), evaluation.verdict)
    if recording is not None:
        compare_lenses(evaluation.verdict, recording)
    return exit_code(evaluation.verdict)


def compare_lenses(verdict: "Verdict", recording: Path) -> None:
    """Print which of the cameras with findings were recorded with another lens; takes some seconds each."""
    from bodycam_ros.lens.recorded_lens import other_lenses

    accused = {finding.subject for finding in verdict.findings if finding.part == "camera"}
    with waiting("comparing lenses"):
        remarks = [match.text for match in other_lenses(recording, sorted(accused))]
    for remark in remarks:
        Terminal().print(remark, style="red", soft_wrap=True)


def _agreement_options(arguments: argparse.Namespace) -> "AgreementOptions | None":
    """How to compare; None without a truth.

    Raises:
        RecordingError: an option of the truth is given without one.
    """
    from bodycam_ros.evaluate.agree import AgreementOptions
    from bodycam_ros.formats.read_captured import is_captured

    if arguments.truth is None:
        for flag in ("align", "clock", "points"):
            if getattr(arguments, flag) is not None:
                raise RecordingError(f"--{flag} needs --truth, which OUT is compared with")
        return None
    clock = arguments.clock or (_FOUND if is_captured(arguments.truth) else _SHARED)
    return AgreementOptions(arguments.align or _ALIGNMENTS[0], clock == _SHARED, arguments.points)


def _outside_files(arguments: argparse.Namespace) -> "OutsideFiles | None":
    """Files of static cameras; None without them.

    Raises:
        StationError: an option of static cameras is given without their poses, or without their images.
    """
    from bodycam_ros.evaluate.outside_picture import OutsideFiles

    if arguments.stations is None:
        for flag in ("surface", "map", "overlay_video"):
            if getattr(arguments, flag) is not None:
                raise StationError(f"--{flag.replace('_', '-')} needs --stations, where the static cameras are")
        return None
    if arguments.recording is None:
        raise StationError("--stations: needs the images of static cameras: give the bag with --recording")
    return OutsideFiles(arguments.stations, arguments.surface, arguments.map)


def _outside_pictures(
    evaluation: "Evaluation", recording: Path, files: "OutsideFiles", video: str | None, progress: "Progress"
) -> Mapping[str, Callable[[Path], None]]:
    """Name of a file -> writes it to a path.

    Raises:
        StationError: the stations cannot be used, or the recording has no images of them while it was solved.
        BodyError: the surface cannot be used.
        RecordingError: not a recording, or an image that cannot be decoded.
    """
    from bodycam_ros.evaluate.feet_picture import draw_feet, has_feet
    from bodycam_ros.evaluate.outside_picture import OutsideScene, draw_outside, outside_views
    from bodycam_ros.evaluate.overlay_picture import check_station, draw_outside_video
    from bodycam_ros.evaluate.report_folder import FEET, OUTSIDE, VIDEO

    solved = evaluation.solved
    scene = OutsideScene.read(solved, recording, files)
    if video is not None:
        check_station(scene, video)
    views = outside_views(scene, solved, recording)
    if not views:
        raise StationError(
            f"{recording}: has no image of its static cameras ({', '.join(scene.stations)}) in the middle of what "
            f"{solved.path} has; is it the recording that this was solved from?"
        )
    more: dict[str, Callable[[Path], None]] = {OUTSIDE: partial(draw_outside, views)}
    if has_feet(evaluation):
        more[FEET] = partial(draw_feet, evaluation)
    if video is not None:
        anew = scene.unlearned()
        more[VIDEO] = lambda path: draw_outside_video(anew, solved, recording, video, path, progress)
    return more


def _check_earlier(folder: Path) -> None:
    """Refuse to replace pictures that no evaluation made: it writes figures along with each.

    Raises:
        OutputError: there are such.
    """
    from bodycam_ros.evaluate.report_folder import FIGURES, WRITTEN
    from bodycam_ros.output_place import check_file

    check_file(folder / FIGURES, force=True, mark=b'"image_coverage"', what="summary of 'bodycam evaluate'")
    if not (folder / FIGURES).exists():
        for name in WRITTEN:
            check_file(folder / name, force=False, mark=b"", what="part of a report")


def _print(evaluation: "Evaluation", folder: Path) -> None:
    from bodycam_ros.evaluate.agreement_section import agreement_lines
    from bodycam_ros.evaluate.summary import summary

    figures, agreement = summary(evaluation), evaluation.agreement
    console = widened(Terminal())  # units are in square brackets
    for table in figure_tables(figures, evaluation.verdict):
        console.print(table)
    if evaluation.gait is not None:
        console.print(gait_table(evaluation.gait, evaluation.true_gait))
    lines = list(_remarks(figures))
    if agreement is not None and (evaluation.comparison is None or agreement.clock.start_sigma_s != 0.0):
        lines += agreement_lines(agreement)
    for line in (*lines, f"written to {folder}"):
        console.print(line, soft_wrap=True)
    for doubt in () if agreement is None else agreement.doubts:
        console.print(Text(f"doubtful: {doubt}", "yellow"), soft_wrap=True)


def _remarks(figures: Mapping[str, Any]) -> Iterator[str]:
    yield (
        f"{figures['instants']} instants in {figures['duration_s']:.2f} s, {figures['image_coverage']:.1%} of the "
        f"images covered; {figures['instants_without_camera']} instants without any camera"
    )
    if figures["blur"]:
        yield f"registered at a motion of {_by_motion(figures['blur'])} px per image"
    yield from (f"not solved: {start:.2f} to {end:.2f} s" for start, end in figures["gaps_s"])
    sliding = figures["sliding"].get("all", {"stances": 0})
    if sliding["stances"]:
        beyond = figures.get("sliding_against_truth", {}).get("all", {"beyond": {"stances": 0}})["beyond"]
        against = f"; {beyond['mean_mm']:.2f} mm beyond the true ones" if beyond["stances"] else ""
        yield (
            f"feet in stance slide by {sliding['mean_mm']:.2f} mm on average, {sliding['max_mm']:.1f} mm at most, in "
            f"{sliding['stances']} stances of heel or ball{against}"
        )
    if "truth" in figures:
        truth = figures["truth"]
        yield f"truth: coverage {truth['coverage']:.1%}, scale {truth['scale']:.5f}, tilt {truth['tilt_deg']:.3f} deg"
        if truth["links_missing"]:
            yield f"in the truth, but not in the body: {', '.join(truth['links_missing'])}"


def _by_motion(classes: Sequence[Mapping[str, Any]]) -> str:
    """The registered share of each class of image motion; the last class has no upper end."""
    spans = [f"{c['low_px']:g}" + ("+" if c["high_px"] is None else f" to {c['high_px']:g}") for c in classes]
    return ", ".join(f"{span}: {c['registered']:.1%}" for span, c in zip(spans, classes, strict=True))
