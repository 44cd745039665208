"""bodycam evaluate: measure how good a solved recording is, alone or against truth; exit code 3 if it is wrong."""

import argparse
from pathlib import Path

from bodycam_ros.cli.options import add_option, add_output, add_span, given_flags, given_span, input_paths
from bodycam_ros.cli.output import print_sections, print_verdict, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import RecordingError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("solved", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote")
    add_output(
        parser,
        "DIR",
        "folder for report.html, summary.json and their pictures",
        "pictures in DIR that this command did not write",
    )
    bag_help = "bag that OUT was solved from: adds reprojection errors and overlay.png"
    add_option(parser, "--recording", metavar="BAG", help=bag_help)
    add_option(parser, "--imu")
    add_option(parser, "--map", help="reference map that OUT was solved in: adds way.png, the way in the place")
    without_help = "bag of the same recording solved without --equipment: adds what the equipment changes"
    add_option(parser, "--without", metavar="OUT2", help=without_help)
    add_span(parser)
    add_option(
        parser,
        "--normal",
        metavar="CSV",
        help="table of normal joint angles (columns joint,percent,mean,sd; hip, knee and ankle; degrees): a band in "
        "angles.png where somebody walks",
    )
    truth = parser.add_argument_group("against the truth or another system")
    truth.add_argument(
        "--truth",
        type=Path,
        metavar="X",
        help="folder of a recording with ground truth, or what another system captured: .trc, .c3d, .csv (Motive), "
        ".tsv (Qualisys), .mvnx, .sto, .mot, .glb, .gltf, .bvh, .tum, or a folder of .tum",
    )
    truth.add_argument(
        "--align",
        choices=("similarity", "rigid", "icp"),
        help="how worlds are aligned (default: similarity, as in the paper); icp: the other system tracks the centres "
        "of the body cameras under any names: each track's camera is found by its places",
    )
    truth.add_argument(
        "--clock",
        choices=("found", "shared"),
        help="shared: the other system's stamps are of the clock of this recording; found: clock offset and rate are "
        "estimated from the motion (default)",
    )
    truth.add_argument(
        "--points",
        type=Path,
        metavar="POINTS.YAML",
        help="YAML with the meaning of points whose names are unknown: 'RKNE: thigh_right' is a marker on that "
        "segment, 'RKJC: knee_right' the centre of that joint; a camera's name is its centre; null leaves a point out",
    )
    static = parser.add_argument_group("static cameras")
    static_cameras_help = "with --recording: where its static cameras are; adds outside.png, the body over their images"
    add_option(static, "--stations", needs="recording", help=static_cameras_help)
    add_option(static, "--surface")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # matplotlib takes half a second to load; the other commands and --help do without.
    from bodycam_ros.evaluate.agreement import AgreementOptions
    from bodycam_ros.evaluate.evaluation import evaluate
    from bodycam_ros.evaluate.image_views import ImageView, body_camera_views, static_camera_views
    from bodycam_ros.evaluate.report import check_report_folder, report_lines, write_report
    from bodycam_ros.evaluate.report_sections import report_sections
    from bodycam_ros.formats.read_captured import is_captured
    from bodycam_ros.registration.reference_map import ReferenceMap
    from bodycam_ros.results.provenance import warn_of_differences
    from bodycam_ros.static_cameras.start_file import StaticCameraFiles

    folder, recording = arguments.output, arguments.recording
    if arguments.truth is None or not is_captured(arguments.truth):
        for flag in given_flags(arguments, "align", "clock", "points"):
            raise RecordingError(f"{flag} needs --truth with what another system captured, which OUT is compared with")
    options = AgreementOptions(
        arguments.align != "rigid", arguments.clock == "shared", arguments.points, arguments.align == "icp"
    )
    if options.by_places and (given := given_flags(arguments, "clock", "points")):
        raise RecordingError(f"{', '.join(given)}: --align icp finds names and clock by itself; leave it out")
    span = given_span(arguments)
    check_report_folder(folder, input_paths(arguments), arguments.force)
    with shown_progress() as progress:
        with progress.step("reading and measuring", 1):
            evaluation = evaluate(
                arguments.solved,
                arguments.truth,
                recording,
                options,
                tuple(arguments.imu),
                span,
                arguments.normal,
                arguments.without,
            )
        reference_map = None if arguments.map is None else ReferenceMap.load(arguments.map)
        if reference_map is not None and arguments.stations is None:
            warn_of_differences(arguments.solved, (reference_map, arguments.map))
        with progress.step("drawing", 1):
            overlay = () if recording is None else tuple(body_camera_views(evaluation.solved, recording))
            views: tuple[ImageView, ...] = ()
            if arguments.stations is not None:
                files = StaticCameraFiles(arguments.stations, arguments.surface, None)
                views = static_camera_views(evaluation.solved, recording, files, arguments.map)
            write_report(evaluation, folder, overlay, views, reference_map)
    terminal = Terminal()
    print_sections(terminal, report_sections(evaluation.figures))
    terminal.print("\n".join([*report_lines(evaluation), f"written to {folder}"]))
    for doubt in () if evaluation.agreement is None else evaluation.agreement.doubts:
        terminal.print(f"doubtful: {doubt}", style="yellow")
    return print_verdict(terminal, evaluation.verdict)
