"""bodycam replay: solve a bag, and write a bag with joint states; exit code 3 where the result should not be used."""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from bodycam_ros.cli.options import (
    PIPELINE,
    add_config,
    add_equipment,
    add_option,
    add_output,
    add_span,
    add_topics,
    given_span,
    input_paths,
    number,
    pipeline_settings,
    topic_names,
)
from bodycam_ros.errors import SettingsError, StaticCameraError
from bodycam_ros.files.output_place import check_output
from bodycam_ros.replaying.preview import PARTS
from bodycam_ros.replaying.worker_process import warm_up

if TYPE_CHECKING:
    from bodycam_ros.replaying.replay_request import ReplayRequest
    from bodycam_ros.static_cameras.start_file import StaticCameraFiles


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_inputs(parser)
    add_output(parser, "OUT", "ros2 bag folder to write")
    parser.add_argument(
        "--stretches",
        type=_stretches,
        metavar="N",
        help="solve a long recording in N stretches of half a minute or more, each in a process of its own, or 'auto': "
        "as many as --jobs. For a known map; on several computers 'bodycam replay first', 'stretch' and 'merge' do the "
        "same",
    )
    parser.add_argument(
        "--preview",
        type=number(int, 1, 10000),
        nargs="?",
        const=PARTS,
        default=0,
        metavar="N",
        help="look at a long recording first: solve 2 s of every 20, or N such parts evenly over all of it, if that is "
        f"less (default: {PARTS}, a minute with two cores). What is solved is as good as ever, but for clocks and "
        "read-out times; the rest is missing, and OUT and its verdict say so",
    )


def add_inputs(parser: argparse.ArgumentParser) -> None:
    """Add what is solved and how: arguments of a replay, of its stretches, and of their merge."""
    add_option(parser, "recording")
    add_option(parser, "--map")
    body_help = "body YAML, made by 'bodycam body': segments, joints, camera mounts"
    add_option(parser, "--body", required=True, help=body_help)
    add_option(parser, "--imu")
    add_topics(parser)
    add_equipment(parser)
    static_cameras_help = (
        "where static cameras of the same bag are, as 'bodycam stations' writes it; without --map its own frame is the "
        "world, and body cameras are not used"
    )
    add_option(parser, "--stations", help=static_cameras_help)
    add_option(parser, "--surface")
    start_help = (
        "with --stations: where the segments are in the first image: a file, a folder with 2-D keypoints of each "
        "camera, or auto, which detects the person in the first images; not needed if body cameras are registered"
    )
    add_option(parser, "--start", help=start_help)
    add_option(parser, "--person")
    add_option(parser, "--keypoints")
    add_span(parser)
    parser.add_argument(
        "--all",
        action="store_true",
        help="solve the whole recording (default: from the first to the last image at which three quarters of the "
        "body's cameras run, or the part of --from and --to)",
    )
    parser.add_argument(
        "--passes",
        type=number(int, 1, 100),
        default=1,
        metavar="N",
        help="passes over the recording; all but the last add the landmarks that its cameras see to a copy of the map. "
        "Use 3 if the map shows only a part of the place (default: 1)",
    )
    parser.add_argument(
        "--slim",
        action="store_true",
        help="do not write tracks and landmarks, which are three quarters of OUT; 'bodycam evaluate' then has no "
        "reprojection errors",
    )
    add_option(parser, "--jobs", help="processes for the cameras (default: all cores)")
    add_config(parser, PIPELINE)


def given_request(arguments: argparse.Namespace, writes_bag: bool = True) -> "ReplayRequest":
    """What is asked for; its output is refused where it would overwrite an input.

    Args:
        arguments: of the command line.
        writes_bag: the output is a bag.

    Raises:
        BodycamError: options that do not fit each other, or an output that must not be replaced.
    """
    from bodycam_ros.recording.bag_writer import check_replaceable
    from bodycam_ros.replaying.replay_request import ReplayRequest

    request = ReplayRequest(
        arguments.recording,
        arguments.map,
        arguments.body,
        arguments.output,
        settings=pipeline_settings(arguments),
        jobs=arguments.jobs,
        force=arguments.force,
        equipment=arguments.equipment,
        outside=_outside(arguments),
        slim=arguments.slim,
        passes=arguments.passes,
        imus=tuple(arguments.imu),
        names=topic_names(arguments),
        span=given_span(arguments),
        whole=arguments.all,
    )
    check_output(arguments.output, input_paths(arguments))
    if writes_bag and arguments.output.exists():
        check_replaceable(arguments.force, arguments.output)
    return request


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    warm_up()  # the processes for the cameras load what they need while this one does
    from bodycam_ros.cli.output import shown_progress
    from bodycam_ros.cli.print_replay import print_replay
    from bodycam_ros.replaying.replay import replay
    from bodycam_ros.replaying.stretches import replay_in_stretches

    request = replace(given_request(arguments), preview=arguments.preview)
    if request.preview and arguments.stretches is not None:
        raise SettingsError("--preview solves parts in one process, not in stretches; leave --stretches out")
    with shown_progress() as progress:
        if arguments.stretches is None:
            summary = replay(request, progress.show)
        else:
            count = request.jobs if arguments.stretches == AUTO_COUNT else arguments.stretches
            summary = replay_in_stretches(request, count, on_step=progress.show)
    return print_replay(summary, request.recording, request.output, request.names)


AUTO_COUNT = 0


def _stretches(text: str) -> int:
    return AUTO_COUNT if text == "auto" else number(int, 1, 10000)(text)


def _outside(arguments: argparse.Namespace) -> "StaticCameraFiles | None":
    """Files of static cameras; None without them.

    Raises:
        StaticCameraError: an option is given without static cameras, or the world or the map of --passes is missing.
    """
    if arguments.map is None and arguments.passes > 1:
        raise StaticCameraError("--passes extends a reference map before the last pass: give it with --map")
    if arguments.stations is not None:
        from bodycam_ros.static_cameras.start_file import StaticCameraFiles

        given = StaticCameraFiles(
            arguments.stations, arguments.surface, arguments.start, arguments.keypoints, arguments.person or 1
        )
        return replace(given, start=given.start or given.evidence)
    if arguments.map is None:
        raise StaticCameraError("give the place's reference map with --map, or static cameras with --stations")
    return None
