"""What ``bodycam map --from-bag`` takes from the worn cameras of a recording."""

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.whole_file import scratch_folder

if TYPE_CHECKING:
    from bodycam_ros.mapping.known_distance import KnownDistance
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.mapping.photographs import Photographs


def add_worn_flags(parser: argparse.ArgumentParser) -> None:
    """Add --from-bag and what goes with it."""
    parser.add_argument(
        "--from-bag",
        type=Path,
        metavar="BAG",
        help="make the map of what the worn cameras of this recording see, as of a range of motion, instead of SOURCE",
    )
    parser.add_argument("--rig", type=Path, help="with --from-bag: which cameras are worn (default: all in the bag)")
    parser.add_argument(
        "--known-distance",
        nargs=3,
        action="append",
        default=[],
        metavar=("CAMERA", "CAMERA", "METRES"),
        help="with --from-bag: distance between the lenses of two cameras on one segment, by a tape; it scales the map "
        "where no board is seen. The farther apart the better; may be given several times",
    )


def check_worn(arguments: argparse.Namespace) -> None:
    """Refuse flags that do not go together, before the work.

    Raises:
        MapError: so they do.
    """
    if arguments.from_bag is None:
        given = ["--rig"] * (arguments.rig is not None) + ["--known-distance"] * bool(arguments.known_distance)
        if given:
            raise MapError(f"{given[0]} is for the worn cameras of a recording; give that with --from-bag")
        if arguments.source is None:
            raise MapError("nothing to make a map of; give REFERENCE_DIR, VIDEO or BAG, or --from-bag BAG")
        return
    if arguments.source is not None:
        raise MapError(
            f"give either {arguments.source} or --from-bag {arguments.from_bag}: a map is made of one of them"
        )
    for flag in ("topic", "camera", "keep_frames", "model"):
        if getattr(arguments, flag) is not None:
            name = f"--{flag.replace('_', '-')}"
            raise MapError(f"{name} does not go with --from-bag, which takes all worn cameras as the bag has them")
    known_distances(arguments)


def known_distances(arguments: argparse.Namespace) -> "tuple[KnownDistance, ...]":
    """Those that the user has measured.

    Raises:
        MapError: one of them is none, or between cameras on different segments.
    """
    from bodycam_ros.calibration.rig import Rig
    from bodycam_ros.mapping.known_distance import KnownDistance

    rig = None if arguments.rig is None else Rig.from_yaml(arguments.rig)
    distances = []
    for first, second, text in arguments.known_distance:
        try:
            metres = float(text)
        except ValueError as error:
            raise MapError(f"--known-distance {first} {second} {text}: the last must be a number of metres") from error
        if rig and (unknown := [camera for camera in (first, second) if camera not in rig.cameras]):
            raise MapError(
                f"--known-distance {first} {second}: {arguments.rig} has no camera {unknown[0]}; it has "
                f"{', '.join(sorted(rig.cameras))}"
            )
        segments = {rig.cameras[camera] for camera in (first, second)} if rig else {""}
        if len(segments) > 1:
            raise MapError(
                f"--known-distance {first} {second}: they are on different segments by {arguments.rig}, so their "
                "distance is not the same all the time; measure one between cameras on the same segment"
            )
        distances.append(KnownDistance(first, second, metres))
    return tuple(distances)


@contextmanager
def worn_photographs_of(
    arguments: argparse.Namespace, settings: "MapSettings", progress: Progress
) -> "Iterator[Photographs]":
    """The keyframes of the worn cameras; they are gone when the block ends.

    Raises:
        BodycamError: the recording cannot be read, or makes no photographs.
    """
    from bodycam_ros.calibration.rig import Rig
    from bodycam_ros.mapping.frame_choice import keep_sharp_frames
    from bodycam_ros.mapping.moving_camera import open_body_cameras
    from bodycam_ros.mapping.photographs import BOARD_FILE

    bag: Path = arguments.from_bag
    cameras = None if arguments.rig is None else tuple(Rig.from_yaml(arguments.rig).cameras)
    pairs = [(known.first, known.second) for known in known_distances(arguments)]
    board = bag.resolve().parent / BOARD_FILE
    with scratch_folder(Path(tempfile.gettempdir())) as scratch:
        yield keep_sharp_frames(
            open_body_cameras(bag, cameras, [camera for pair in pairs for camera in pair]),
            scratch / "keyframes",
            bag.resolve().name,
            settings.frames,
            max(1, arguments.jobs),
            progress,
            board if board.is_file() else None,
            pairs,
        )
