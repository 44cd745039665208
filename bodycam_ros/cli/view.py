"""bodycam view: map, body and recording in a browser, to inspect them and to correct mounts and joints."""

import argparse
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path

from bodycam_ros.cli.options import add_option, check_files, given_flags
from bodycam_ros.errors import ViewError
from bodycam_ros.static_cameras.start_file import StaticCameraFiles
from bodycam_ros.viewer.sources import Sources

PORT = 8080


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    out_help = "bag that 'bodycam replay' wrote (without it: the body in its N-pose)"
    add_option(parser, "solved", nargs="?", metavar="OUT", help=out_help)
    add_option(parser, "--map")
    body_help = "body YAML; corrections are written to it (default: the body in OUT, without writing corrections)"
    add_option(parser, "--body", metavar="BODY.yaml", help=body_help)
    add_option(parser, "--recording", metavar="BAG", help="bag that OUT was solved from: shows its images")
    add_option(parser, "--stations", help="file of static cameras; they and their images are shown")
    add_option(parser, "--surface")
    parser.add_argument("-o", "--output", type=Path, metavar="START.yaml", help="with --place: the file to write")
    parser.add_argument("--force", action="store_true", help="replace the output, if already there")
    place_help = "place the body by hand in the first images of --stations, and write the START.yaml that -o names"
    add_option(parser, "--place", metavar="BAG", help=place_help)
    add_option(
        parser,
        "--start",
        needs="place",
        help="with --place: START.yaml with the initial pose of the body, or auto, which detects the person",
    )
    add_option(parser, "--person")
    height_help = "with --place, instead of --body: lengths of people of this height"
    add_option(parser, "--height", needs="place", help=height_help)
    parser.add_argument(
        "--live",
        action="store_true",
        help="show what the running graph publishes (needs ROS 2); --map, --namespace and --port apply",
    )
    name_help = "with --live: namespace of the person's graph, such as anna"
    add_option(parser, "--namespace", type=str, metavar="NAME", needs="live", help=name_help)
    parser.add_argument(
        "--port", type=int, default=PORT, help=f"port of the page on this machine; 0: any free port ({PORT})"
    )
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
        raise ViewError(
            f"{arguments.output}: 'bodycam view' writes no film; 'bodycam film OUT -o walk.mp4' does, with --view "
            "camera:NAME over the images of a camera"
        )
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


def _place(arguments: argparse.Namespace) -> None:
    _refuse(arguments, "--place: a start is made of a recording that is not solved yet", "recording")
    if arguments.stations is None or arguments.output is None:
        arguments.usage_error("--place needs --stations CAMERAS.YAML and -o START.yaml")
    if (arguments.body is None) == (arguments.height is None):
        arguments.usage_error("--place needs either --body BODY.yaml or --height METRES")
    check_files(arguments, (arguments.output, b": [", "start"))
    from bodycam_ros.viewer.placing import PlacingSession, PlacingSources
    from bodycam_ros.viewer.server import LocalServer

    files = StaticCameraFiles(arguments.stations, arguments.surface, arguments.start, person=arguments.person or 1)
    output = arguments.output
    sources = PlacingSources(arguments.place, files, arguments.body or arguments.height, arguments.map)
    server = LocalServer(arguments.port, f"bodycam view: {output.name}")
    server.serve(lambda server: PlacingSession(server, sources, output))


def _refuse(arguments: argparse.Namespace, reason: str, *flags: str) -> None:
    """Refuse OUT, and flags that were given."""
    if unused := [*(["OUT"] if arguments.solved is not None else []), *given_flags(arguments, *flags)]:
        raise ViewError(f"{reason}; leave out {', '.join(unused)}")


def _view_live(arguments: argparse.Namespace) -> None:
    unused = ("body", "recording", "stations", "surface", "output", "place", "start", "height")
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
