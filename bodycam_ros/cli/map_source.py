"""What ``bodycam map`` makes a map of: photographs, or the sharp frames of a video or of one camera of a bag."""

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bodycam_ros.cli.map_from_bag import add_worn_flags, check_worn, worn_photographs_of
from bodycam_ros.errors import MapError
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.output_place import check_output
from bodycam_ros.whole_file import scratch_folder

if TYPE_CHECKING:
    from bodycam_ros.mapping.map_settings import MapSettings
    from bodycam_ros.mapping.moving_camera import MovingCamera
    from bodycam_ros.mapping.photographs import Photographs

_BAG_SUFFIXES = {".mcap", ".db3"}
_BAG_FILE = "metadata.yaml"


def add_source_flags(parser: argparse.ArgumentParser) -> None:
    """Add SOURCE and what says how to read it."""
    parser.add_argument(
        "source",
        type=Path,
        nargs="?",
        metavar="REFERENCE_DIR|VIDEO|BAG",
        help="folder with photographs (jpg, png) and camera.yaml; or a video, or a bag with --topic, of a walk through "
        "the place, of which sharp frames are taken",
    )
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="YAML",
        help="lens, as camera_info YAML (default: REFERENCE_DIR/camera.yaml, VIDEO with the suffix .yaml, or what the "
        "bag says)",
    )
    parser.add_argument(
        "--topic", help="images of the camera in BAG that was carried, as /hand/image_raw/compressed (the only one)"
    )
    parser.add_argument(
        "--keep-frames", type=Path, metavar="DIR", help="keep the frames that were taken, as a REFERENCE_DIR to be"
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="COLMAP_DIR",
        help="take over this COLMAP model of the same photographs, and its camera where they have no camera.yaml",
    )
    add_worn_flags(parser)


def check_source(arguments: argparse.Namespace) -> None:
    """Refuse flags that do not go together, before the work.

    Raises:
        MapError: there is no source, or a flag that it has no use for.
        OutputError: the frames cannot be kept where they should.
    """
    from bodycam_ros.mapping.frame_choice import check_frames_replaceable

    check_worn(arguments)
    if arguments.source is not None and not arguments.source.exists():
        raise MapError(
            f"{arguments.source}: no such folder or file; expected a folder with photographs and camera.yaml, a video, "
            "or a bag"
        )
    moving = arguments.source is not None and is_moving(arguments.source)
    if arguments.topic is not None and not is_bag(arguments.source):
        raise MapError(f"{arguments.source}: is no bag, so it has no topic {arguments.topic}; leave --topic out")
    if arguments.keep_frames is not None:
        if not moving:
            raise MapError(f"{arguments.source}: is no video or bag; --keep-frames is for frames of these")
        check_output(arguments.keep_frames, (arguments.source, arguments.camera, arguments.board, arguments.config))
        check_output(arguments.output, (arguments.keep_frames,))
        check_frames_replaceable(arguments.keep_frames, arguments.force)
    if arguments.model is not None:
        if moving:
            raise MapError("--model is of photographs; give their folder, not a video or bag")
        if not arguments.model.is_dir():
            raise MapError(f"{arguments.model}: is no folder; give that of a COLMAP model (cameras, images, points3D)")


@contextmanager
def photographs_of(
    arguments: argparse.Namespace, settings: "MapSettings", progress: Progress
) -> "Iterator[Photographs]":
    """The photographs, whatever they come from; those that were taken of a recording are gone when the block ends.

    Raises:
        BodycamError: the source cannot be read, or makes no photographs.
    """
    from bodycam_ros.lens.compared_lens import compare_lens
    from bodycam_ros.mapping.frame_choice import keep_sharp_frames
    from bodycam_ros.mapping.moving_camera import BagCamera, VideoCamera
    from bodycam_ros.mapping.photographs import BOARD_FILE, find_photographs

    if arguments.from_bag is not None:
        with worn_photographs_of(arguments, settings, progress) as worn:
            yield worn
        return
    source: Path = arguments.source
    if not is_moving(source):
        yield find_photographs(source, arguments.camera, arguments.model)
        return
    camera: MovingCamera
    if is_bag(source):
        camera = BagCamera(source, arguments.topic, arguments.camera)
    else:
        camera = VideoCamera(source, arguments.camera)
    compare_lens(camera)
    with scratch_folder(Path(tempfile.gettempdir())) as scratch:
        folder: Path = arguments.keep_frames or scratch / "frames"
        board = source.resolve().parent / BOARD_FILE
        yield keep_sharp_frames(
            {camera.name: camera},
            folder,
            camera.name,
            settings.frames,
            max(1, arguments.jobs),
            progress,
            board if board.is_file() else None,
            force=arguments.force,
        )


def is_bag(source: Path) -> bool:
    """Whether a path is a ros2 bag: a folder with its metadata, or one of its files."""
    return source.suffix.lower() in _BAG_SUFFIXES or (source / _BAG_FILE).is_file()


def is_moving(source: Path) -> bool:
    """Whether a path is a recording, and no folder of photographs."""
    return is_bag(source) or source.is_file()
