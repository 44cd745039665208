"""bodycam view: map, body and recording in a browser, to inspect them and to correct mounts and joints (A 4.2)."""

import argparse
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path

from bodycam_ros.cli.options import add_option, check_files, given_flags
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import ViewError
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.viewer.sources import Sources

PORT = 8080


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    out_help = "bag that 'bodycam replay' wrote (without it: the body in its N-pose)"
    add_option(parser, "solved", nargs="?", metavar="OUT", help=out_help)
    add_option(parser, "--map")
    body_help = "body, which corrections are written to (default: that of OUT, and none are)"
    add_option(parser, "--body", metavar="BODY.yaml", help=body_help)
    add_option(parser, "--recording", metavar="BAG", help="bag that OUT was solved from: shows its images")
    add_option(parser, "--stations", help="where static cameras are: shows them and their images")
    add_option(parser, "--surface")
    video_help = "file to write: a video of the body, without a browser; with --place the start of the static cameras"
    parser.add_argument("-o", "--output", type=Path, metavar="OUT.mp4", help=video_help)
    over_help = "with -o and --recording: over the images of this camera, not from outside"
    add_option(parser, "--over", type=str, metavar="CAMERA", needs="output", help=over_help)
    parser.add_argument("--force", action="store_true", help="replace the output, if already there")
    place_help = "place the body by hand in the first images of --stations, and write the START.yaml that -o names"
    add_option(parser, "--place", metavar="BAG", help=place_help)
    add_option(
        parser,
        "--start",
        needs="place",
        help="with --place: where the body is at first, or auto, which detects the person",
    )
    add_option(parser, "--person")
    height_help = "with --place, instead of --body: lengths of people of this height"
    add_option(parser, "--height", needs="place", help=height_help)
    parser.add_argument(
        "--live",
        action="store_true",
        help="show what the running graph publishes (needs ROS 2); --map, --namespace and --port apply",
    )
    name_help = "with --live: of the person's graph, as anna"
    add_option(parser, "--namespace", type=str, metavar="NAME", needs="live", help=name_help)
    parser.add_argument("--port", type=int, default=PORT, help=f"of this machine; 0 takes any free one ({PORT})")
    parser.set_defaults(usage_error=parser.error)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    if arguments.live:
        # It has no end of its own: to be stopped, by a launch file for instance, is no failure.
        with suppress(KeyboardInterrupt):
            _view_live(arguments)
    elif arguments.place is not None:
        _place(arguments)
    elif arguments.output is not None:
        _write_video(arguments)
    else:
        # The web server takes half a second to load; the other commands and --help do without.
        from bodycam_ros.viewer.server import LocalServer
        from bodycam_ros.viewer.session import Session

        sources = _read_sources(arguments)
        LocalServer(arguments.port, f"bodycam view: {sources.body.name}").serve(lambda server: Session(server, sources))
    return 0


def _read_sources(arguments: argparse.Namespace) -> Sources:
    return Sources(
        arguments.solved,
        arguments.map,
        arguments.body,
        arguments.recording,
        arguments.stations,
        arguments.surface,
    )


def _write_video(arguments: argparse.Namespace) -> None:
    from bodycam_ros.viewer.film import write_film

    check_files(arguments, (arguments.output, b"ftyp", "video"))
    sources = _read_sources(arguments)
    with shown_progress() as progress:
        write_film(sources, arguments.over, arguments.output, progress)
    Terminal().print(f"video written to {arguments.output}")


def _place(arguments: argparse.Namespace) -> None:
    _refuse(arguments, "--place: a start is made of a recording that is not solved yet", "recording", "over")
    if arguments.stations is None or arguments.output is None:
        arguments.usage_error("--place needs --stations CAMERAS.YAML and -o START.yaml")
    if (arguments.body is None) == (arguments.height is None):
        arguments.usage_error("--place needs either --body BODY.yaml or --height METRES")
    check_files(arguments, (arguments.output, b": [", "start"))
    from bodycam_ros.viewer.placing import PlacingSession, PlacingSources
    from bodycam_ros.viewer.server import LocalServer

    files = StaticCameraFiles(arguments.stations, arguments.surface, arguments.start, arguments.person or 1)
    output = arguments.output
    sources = PlacingSources(arguments.place, files, arguments.body or arguments.height, arguments.map)
    server = LocalServer(arguments.port, f"bodycam view: {output.name}")
    server.serve(lambda server: PlacingSession(server, sources, output))


def _refuse(arguments: argparse.Namespace, reason: str, *flags: str) -> None:
    """Refuse OUT, and flags that were given."""
    if unused := [*(["OUT"] if arguments.solved is not None else []), *given_flags(arguments, *flags)]:
        raise ViewError(f"{reason}; leave out {', '.join(unused)}")


def _view_live(arguments: argparse.Namespace) -> None:
    unused = ("body", "recording", "stations", "surface", "output", "over", "place", "start", "height")
    _refuse(arguments, "--live: the running graph publishes the body", *unused)
    try:
        listener = import_module("bodycam_ros.nodes.body_listener").BodyListener
    except ImportError as error:
        raise ViewError(
            f"--live: needs ROS 2, which this Python does not find ({error}); source its setup file first, or take the "
            "wheels that 'make test' installs"
        ) from error
    from bodycam_ros.registration.reference_map import ReferenceMap
    from bodycam_ros.viewer.live_session import LiveSession
    from bodycam_ros.viewer.server import LocalServer

    reference_map = None if arguments.map is None else ReferenceMap.load(arguments.map)
    with ExitStack() as listening:

        def open_page(server: LocalServer) -> LiveSession:
            page = LiveSession(server, reference_map)
            listening.callback(listener(page.put_body, page.put_state, arguments.namespace or "").stop)
            return page

        LocalServer(arguments.port, "bodycam view: live").serve(open_page)
