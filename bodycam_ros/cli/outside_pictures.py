"""What 'bodycam evaluate' is told of static cameras, and the pictures that it draws of them."""

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.errors import StationError
from bodycam_ros.mapping.progress import Progress

if TYPE_CHECKING:
    from bodycam_ros.evaluate.evaluation import Evaluation
    from bodycam_ros.evaluate.outside_picture import OutsideFiles


def add_outside_flags(parser: argparse.ArgumentParser) -> None:
    """Add what is asked of static cameras."""
    parser.add_argument(
        "--stations",
        type=Path,
        metavar="CAMERAS.YAML",
        help="with --recording: where its static cameras stand; adds outside.png, the body over their images, and "
        "feet.png, the ways of the feet",
    )
    parser.add_argument(
        "--surface",
        type=Path,
        metavar="FOLDER",
        help="with --stations: the meshes that OUT was solved with (default: capsules along the bones)",
    )
    parser.add_argument(
        "--map", type=Path, metavar="MAP", help="with --stations: the map that OUT was solved in, if there was one"
    )
    parser.add_argument(
        "--video", metavar="CAMERA", help="with --stations: adds outside.mp4, the body over a static camera's images"
    )


def outside_files(arguments: argparse.Namespace) -> "OutsideFiles | None":
    """What is said of static cameras; None if nothing.

    Raises:
        StationError: something is said without where they stand, or without their images.
    """
    from bodycam_ros.evaluate.outside_picture import OutsideFiles

    if arguments.stations is None:
        for flag in ("surface", "map", "video"):
            if getattr(arguments, flag) is not None:
                raise StationError(f"--{flag} is for static cameras: say with --stations where they stand")
        return None
    if arguments.recording is None:
        raise StationError("--stations: needs the images of static cameras: give the bag with --recording")
    return OutsideFiles(arguments.stations, arguments.surface, arguments.map)


def outside_pictures(
    evaluation: "Evaluation", recording: Path, files: "OutsideFiles", video: str | None, progress: Progress
) -> Mapping[str, Callable[[Path], None]]:
    """Name of a file -> writes it to a path.

    Raises:
        StationError: the stations cannot be used, the recording has no images of them, or not while it was solved.
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
