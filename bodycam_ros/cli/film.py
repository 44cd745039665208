"""bodycam film: the solved person as a character in the place, or drawn over a camera's images, as a video.

Without a display: rays are traced on the processor.
"""

import argparse
from pathlib import Path

from bodycam_ros.cli.options import TRAVEL, add_option, add_output, add_span, check_files, given_span, number
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import ViewError
from bodycam_ros.files.shown import printable

_MARKS = {".mp4": (b"ftyp", "video"), ".png": (b"\x89PNG", "picture"), ".jpg": (b"\xff\xd8", "picture")}

EPILOG = """
views: follow: beside the person; orbit: around the person; fixed: from one place; camera:NAME: over the images of a
camera of the body, or a static one; photo:NAME: over a photograph of the map, whose pose is known
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("solved", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote")
    add_output(parser, "FILE", "video to write, FILE.mp4; FILE.png or FILE.jpg: one picture, of the time of --from")
    parser.add_argument("--view", default="follow", metavar="VIEW", help="where it is seen from (default: follow)")
    add_option(parser, "--map", help="reference map: its points are the place, its photographs views")
    add_option(parser, "--recording", metavar="BAG", help="bag that OUT was solved from, with the images of cameras")
    add_option(parser, "--stations", help="file of static cameras, whose views can be chosen")
    photos_help = "folder of the map's photographs, for photo:NAME (default: small and grey, as the map has them)"
    add_option(parser, "--photos", metavar="FOLDER", needs="map", help=photos_help)
    beside_help = "show the recorded images of this camera beside the view"
    add_option(parser, "--beside", type=str, metavar="CAMERA", needs="recording", help=beside_help)
    parser.add_argument("--size", type=_size, default=(1920, 1080), metavar="WxH", help="of the video (1920x1080)")
    rate_help = "frames a second of views without images (30)"
    parser.add_argument("--rate", type=number(float, 1.0, 240.0, "Hz"), default=30.0, metavar="HZ", help=rate_help)
    environment_help = "show a place that was not there: road, slope:30 of so many degrees, or FILE.glb"
    parser.add_argument("--environment", metavar="PLACE", help=environment_help)
    travel_help = "with --environment: speed that is added to the motion (0)"
    add_option(parser, "--travel", needs="environment", help=travel_help, **TRAVEL)
    surface_help = "scan of the person, a mesh per segment (thigh_left.obj or .ply); other segments have their girths"
    parser.add_argument("--surface", type=Path, metavar="FOLDER", help=surface_help)
    add_span(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.environment.environment import Environment
    from bodycam_ros.film.write_film import FilmRequest, write_film

    output: Path = arguments.output
    if output.suffix.lower() not in _MARKS:
        raise ViewError(f"{output}: expected a name that ends with .mp4, a video, or .png or .jpg, one picture of it")
    check_files(arguments, (output, *_MARKS[output.suffix.lower()]))
    request = FilmRequest(
        arguments.solved,
        arguments.view,
        arguments.map,
        arguments.recording,
        arguments.stations,
        arguments.photos,
        arguments.beside,
        arguments.size,
        arguments.rate,
        given_span(arguments),
        None if arguments.environment is None else Environment.parse(arguments.environment, arguments.travel or 0.0),
        arguments.surface,
    )
    terminal = Terminal()
    with shown_progress() as progress:
        frames = write_film(request, output, progress, terminal.print)
    terminal.print(f"{frames} frame{'s' if frames > 1 else ''} written to {printable(str(output))}")
    return 0


def _size(text: str) -> tuple[int, int]:
    """Converter of WIDTHxHEIGHT [px], both even; argparse reports anything else."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"expected width and height in pixels, as 1920x1080, not {text!r}")
    size = int(width), int(height)
    if not all(_SMALLEST <= each <= _LARGEST and each % 2 == 0 for each in size):
        raise argparse.ArgumentTypeError(f"expected two even numbers from {_SMALLEST} to {_LARGEST}, not {text!r}")
    return size


_SMALLEST, _LARGEST = 64, 7680
