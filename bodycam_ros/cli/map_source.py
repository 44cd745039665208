"""The images of ``bodycam map``: photographs, or sharp frames of a video or of the body cameras of a bag."""

import argparse
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.options import add_option, given_flags
from bodycam_ros.errors import MapError
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_file import is_bag
from bodycam_ros.whole_file import scratch_folder

if TYPE_CHECKING:
    from bodycam_ros.inertial.map_alignment import InertialAlignment
    from bodycam_ros.mapping.known_distance import KnownDistance
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.mapping.moving_camera import MovingCamera
    from bodycam_ros.mapping.photographs import Photographs
    from bodycam_ros.registration.reference_map import ReferenceMap


def add_source_flags(parser: argparse.ArgumentParser) -> None:
    """Add SOURCE, --from-bag and their options."""
    add_option(
        parser,
        "source",
        nargs="?",
        metavar="REFERENCE_DIR|VIDEO",
        help="folder with photographs (jpg, png) and camera.yaml; or a video of a walk through the place, of which "
        "sharp frames are taken",
    )
    add_option(
        parser,
        "--camera",
        metavar="YAML",
        help="lens, as camera_info YAML (default: REFERENCE_DIR/camera.yaml, or VIDEO with the suffix .yaml)",
    )
    body = parser.add_argument_group("a map from body cameras")
    add_option(body, "--from-bag", metavar="BAG", help="instead of SOURCE: a recording, as of a range of motion")
    add_option(body, "--rig", needs="from_bag", help="the body cameras (default: all in the bag)")
    add_option(
        body,
        "--known-distance",
        type=str,
        needs="from_bag",
        nargs=3,
        action="append",
        default=[],
        metavar=("CAMERA", "CAMERA", "METRES"),
        help="with --from-bag: measured distance between the lenses of two cameras on one segment; it scales the map "
        "where no board is in view. The farther apart the better; may be given several times",
    )
    add_option(body, "--imu", needs="from_bag")


def check_source(arguments: argparse.Namespace) -> "tuple[KnownDistance, ...]":
    """Refuse flags that do not go together, before the work; what --known-distance measures.

    Raises:
        MapError: there is no source, or a flag that does not apply to it.
    """
    source: Path | None = arguments.source
    if arguments.from_bag is not None:
        if source is not None:
            raise MapError(f"give either {source} or --from-bag {arguments.from_bag}: a map is made of one of them")
        for flag in given_flags(arguments, "camera"):
            raise MapError(f"{flag} does not go with --from-bag, which takes all body cameras as the bag has them")
        return _known_distances(arguments)
    if source is None:
        raise MapError("give REFERENCE_DIR or VIDEO, or --from-bag BAG, to make a map of")
    if not source.exists():
        raise MapError(
            f"{source}: no such folder or file; expected a folder with photographs and camera.yaml, or a video"
        )
    if is_bag(source):
        raise MapError(f"{source}: is a bag; give it with --from-bag")
    return ()


def _known_distances(arguments: argparse.Namespace) -> "tuple[KnownDistance, ...]":
    """Those of --known-distance.

    Raises:
        MapError: one of them is no number, or between cameras on different segments.
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
        if rig and rig.cameras[first] != rig.cameras[second]:
            raise MapError(
                f"--known-distance {first} {second}: they are on different segments by {arguments.rig}, so their "
                "distance changes; measure one between cameras on the same segment"
            )
        distances.append(KnownDistance(first, second, metres))
    return tuple(distances)


def inertial_alignment(
    arguments: argparse.Namespace, photographs: "Photographs"
) -> "Callable[[ReferenceMap], InertialAlignment] | None":
    """What finds scale and vertical of a map of body cameras by their inertial sensors; None without any.

    Raises:
        RecordingError: a bag of --imu has none of these cameras' sensors.
    """
    from bodycam_ros.offline.align_map import align_map
    from bodycam_ros.recording.bag_reader import read_imus

    if arguments.from_bag is None:
        return None
    cameras = sorted({camera.name for camera in photographs.camera_of_name.values()})
    imus = read_imus((arguments.from_bag, *arguments.imu), cameras)
    return partial(align_map, recording_path=arguments.from_bag, imus=imus, jobs=arguments.jobs) if imus else None


@contextmanager
def opened_photographs(
    arguments: argparse.Namespace, known: "Sequence[KnownDistance]", settings: "MapSettings", progress: Progress
) -> "Iterator[Photographs]":
    """The photographs; frames of a recording are removed when the block ends, in pairs where a distance is known.

    Raises:
        BodycamError: the source cannot be read, or has no usable images.
    """
    from bodycam_ros.calibration.rig import Rig
    from bodycam_ros.lens.lens_check import warn_of_mismatch
    from bodycam_ros.mapping.frame_choice import keep_sharp_frames
    from bodycam_ros.mapping.moving_camera import open_body_cameras, video_camera
    from bodycam_ros.mapping.photographs import BOARD_FILE, find_photographs

    source: Path = arguments.from_bag or arguments.source
    if arguments.from_bag is None and not source.is_file():
        yield find_photographs(source, arguments.camera)
        return
    board = source.resolve().parent / BOARD_FILE
    pairs = [(each.first, each.second) for each in known]
    cameras: Mapping[str, MovingCamera]
    if arguments.from_bag is not None:
        body_cameras = None if arguments.rig is None else tuple(Rig.from_yaml(arguments.rig).cameras)
        cameras = open_body_cameras(source, body_cameras, [camera for pair in pairs for camera in pair])
        name = source.resolve().name
    else:
        camera = video_camera(source, arguments.camera)
        warn_of_mismatch(camera)
        cameras, name = {camera.name: camera}, camera.name
    with scratch_folder(Path(tempfile.gettempdir())) as scratch:
        yield keep_sharp_frames(
            cameras,
            scratch,
            name,
            settings.frames.most,
            arguments.jobs,
            progress,
            board if board.is_file() else None,
            pairs,
        )
