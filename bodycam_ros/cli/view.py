"""bodycam view: look at map, body and recording in a browser, and correct mounts and joints (A 4.2)."""

import argparse
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path

from bodycam_ros.errors import ViewError
from bodycam_ros.output_place import check_file, check_output
from bodycam_ros.shown import shown

PORT = 8080


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("view", description=__doc__)
    parser.add_argument(
        "solved",
        type=Path,
        nargs="?",
        metavar="OUT",
        help="bag that 'bodycam replay' wrote (without it: the body in its N-pose)",
    )
    parser.add_argument(
        "--map", type=Path, metavar="MAP", help="map folder of 'bodycam map'; may be left out with --stations"
    )
    parser.add_argument("--body", type=Path, metavar="BODY.yaml", help="body, which can be written back")
    parser.add_argument(
        "--live",
        action="store_true",
        help="show what the running graph publishes (needs ROS 2); --map, --namespace, --port and --coarse go with it",
    )
    parser.add_argument("--namespace", default="", metavar="NAME", help="with --live: of the person's graph, as anna")
    parser.add_argument(
        "--recording", type=Path, metavar="BAG", help="bag that OUT was solved from: shows what the cameras saw"
    )
    parser.add_argument(
        "--stations", type=Path, metavar="CAMERAS.YAML", help="where static cameras stand: shows them and what they saw"
    )
    parser.add_argument(
        "--surface",
        type=Path,
        metavar="FOLDER",
        help="a mesh a segment to show on the body (default: the folder that the body file names, else capsules)",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="OUT2", help="another bag solved from the same recording, shown beside OUT"
    )
    parser.add_argument(
        "--video", type=Path, metavar="OUT.mp4", help="write the moving body as a video, from outside, and end"
    )
    parser.add_argument(
        "--from", dest="from_camera", metavar="CAMERA", help="with --video and --recording: over what this camera saw"
    )
    parser.add_argument("--force", action="store_true", help="replace the video")
    parser.add_argument("--coarse", action="store_true", help="draw less finely, for computers without a graphics card")
    parser.add_argument("--port", type=int, default=PORT, help=f"of this machine; 0 takes any free one ({PORT})")
    parser.set_defaults(run=run, usage_error=parser.error)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    if arguments.live:
        # It has no end of its own: to be stopped, by a launch file say, is no failure.
        with suppress(KeyboardInterrupt):
            _view_live(arguments)
        return 0
    if arguments.namespace:
        raise ViewError(f"--namespace {shown(arguments.namespace)}: is for --live")
    if arguments.body is None:
        arguments.usage_error("the following arguments are required: --body")
    if arguments.video is not None:
        _write_film(arguments)
        return 0
    if arguments.from_camera is not None:
        raise ViewError(f"--from {shown(arguments.from_camera)}: is for --video; say where to write it")
    # The web server takes half a second to load; the other commands and --help do without.
    from bodycam_ros.viewer.footage import COARSE, FINE
    from bodycam_ros.viewer.session import view

    view(
        arguments.solved,
        arguments.map,
        arguments.body,
        arguments.recording,
        arguments.port,
        arguments.stations,
        arguments.surface,
        arguments.compare,
        COARSE if arguments.coarse else FINE,
    )
    return 0


def _write_film(arguments: argparse.Namespace) -> None:
    from bodycam_ros.cli.progress import shown_progress
    from bodycam_ros.terminal import Terminal
    from bodycam_ros.viewer.film import write_film
    from bodycam_ros.viewer.sources import Sources

    if arguments.compare is not None:
        raise ViewError("--compare: is shown in the page alone; leave out --video, or compare without it")
    given = (arguments.solved, arguments.map, arguments.body, arguments.recording, arguments.stations)
    check_output(arguments.video, (*given, arguments.surface), makes_folders=False)
    check_file(arguments.video, arguments.force, b"ftyp", "video")
    sources = Sources.read(*given, arguments.surface)
    with shown_progress() as progress:
        write_film(sources, arguments.from_camera, arguments.video, progress)
    Terminal().print(f"video written to {arguments.video}", soft_wrap=True)


def _view_live(arguments: argparse.Namespace) -> None:
    flags = ("body", "recording", "stations", "surface", "compare", "video")
    given = {"OUT": arguments.solved, **{f"--{flag}": getattr(arguments, flag) for flag in flags}}
    given["--from"] = arguments.from_camera
    if told := [name for name, value in given.items() if value is not None]:
        raise ViewError(f"--live: the running graph says where the body is; leave out {', '.join(told)}")
    try:
        listener = import_module("bodycam_ros.nodes.body_topics").BodyListener
    except ImportError as error:
        raise ViewError(
            f"--live: needs ROS 2, which this Python does not find ({error}); source its setup file first, or take the "
            "wheels that 'make test' installs"
        ) from error
    from bodycam_ros.viewer.footage import COARSE, FINE
    from bodycam_ros.viewer.live_session import view_live

    heard = partial(listener, namespace=arguments.namespace)
    view_live(heard, arguments.map, arguments.port, COARSE if arguments.coarse else FINE)
