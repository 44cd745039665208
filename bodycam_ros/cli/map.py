"""bodycam map: build a reference map from photographs of a place, or from a video of a walk through it."""

import argparse
import logging
import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.cli.options import add_config, add_option, add_output, given_flags, input_paths, read_settings
from bodycam_ros.cli.output import StepProgress, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import MapError
from bodycam_ros.files.output_place import check_output
from bodycam_ros.files.shown import other_than
from bodycam_ros.files.whole_file import scratch_folder
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.lens.lens_check import warn_of_mismatch
from bodycam_ros.mapping.build import BuiltMap, build_map
from bodycam_ros.mapping.frame_choice import keep_sharp_frames
from bodycam_ros.mapping.known_distance import KnownDistance
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.moving_camera import MovingCamera, open_body_cameras, video_camera
from bodycam_ros.mapping.photographs import BOARD_FILE, Photographs, find_photographs
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_file import is_bag
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable
from bodycam_ros.replaying.extend import registered_poses

logger = logging.getLogger(__name__)

_FEW_LANDMARKS = 50
"""Landmarks of a photograph: usual ones have a thousand; where two places look alike some dozen fit the wrong one."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
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
    add_option(
        body,
        "--from-bag",
        metavar="BAG",
        help="instead of photographs or a video: a recording, as of a range of motion",
    )
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
    add_option(
        parser,
        "--board",
        help="description of the AprilTag board (default: board.yaml in REFERENCE_DIR, or beside VIDEO or BAG)",
    )
    parser.add_argument("--no-board", action="store_true", help="ignore the board: a map without scale and upward axis")
    add_output(parser, "MAP", "map folder to write")
    add_option(parser, "--jobs", help="threads (default: all cores)")
    add_config(parser, "mapping.map_settings:MapSettings")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    output: Path = arguments.output
    settings = read_settings(arguments, MapSettings)
    check_output(output, input_paths(arguments))
    check_replaceable(output, arguments.force)
    with shown_progress() as progress, _opened_source(arguments, settings, progress) as source:
        photographs, board_path, known, imus = source
        register = partial(registered_poses, recording_path=arguments.from_bag, jobs=arguments.jobs)
        built = build_map(photographs, board_path, settings, arguments.jobs, progress, known, imus, register)
        reference_map, draw, coverage = add_coverage(built.reference_map, output.name, progress)
    replace(built, reference_map=reference_map).save(output, force=arguments.force, also=draw)
    lines = (
        *_registration_lines(built.observed),
        f"{len(reference_map.landmark_ids)} landmarks with {len(reference_map.descriptors)} descriptors",
        *_board_lines(built),
        _scale_line(built),
        _vertical_line(built),
        *coverage,
        f"written to {output}",
    )
    Terminal().print("\n".join(lines))
    return 0


def add_coverage(
    reference_map: ReferenceMap, name: str, progress: StepProgress
) -> tuple[ReferenceMap, Callable[[Path], None], list[str]]:
    """A map with its coverage, a function that draws it into a folder, and lines for the terminal."""
    from bodycam_ros.evaluate.coverage import (
        COVERAGE_FILE,
        coverage_lines,
        measure_coverage,
        upright_map,
        with_coverage,
    )
    from bodycam_ros.evaluate.coverage_picture import draw_coverage

    upright = upright_map(reference_map)
    coverage = measure_coverage(upright, progress)

    def draw(folder: Path) -> None:
        draw_coverage(coverage, upright, folder / COVERAGE_FILE, name)

    lines = [*coverage_lines(coverage), f"coverage is drawn in {COVERAGE_FILE} of the map"]
    return with_coverage(reference_map, coverage), draw, lines


def _registration_lines(observed: Mapping[str, int | None]) -> Iterator[str]:
    registered = {name: landmarks for name, landmarks in observed.items() if landmarks is not None}
    yield f"{len(registered)} of {len(observed)} photographs registered"
    if left_out := [name for name in observed if name not in registered]:
        yield f"NOT registered: {', '.join(left_out)}"
    if weak := {name: landmarks for name, landmarks in registered.items() if landmarks < _FEW_LANDMARKS}:
        named = ", ".join(f"{name} ({landmarks} landmarks)" for name, landmarks in weak.items())
        yield f"registered by few landmarks, perhaps wrongly: {named}; photograph more between them and the others"


def _board_lines(built: BuiltMap) -> Iterator[str]:
    if (residual := built.residual) is not None:
        views = residual.views_of_tag.values()
        yield (
            f"board: {len(views)} tags, each in {min(views)} to {max(views)} photographs, residual "
            f"{residual.rms_px:.3f} px, {residual.rms_mm:.2f} mm"
        )


def _scale_line(built: BuiltMap) -> str:
    known = built.known_scale
    if not built.reference_map.metric:
        return "NOT metric: without a board, a known distance or inertial sensors the scale is arbitrary"
    if known is not None and built.residual is not None:
        share, sigma = 100 / known.scale, 100 * known.sigma
        return f"metric, by the board; in it the known distance is {share:.1f} +- {sigma:.1f} % of the given one"
    if known is not None:
        return f"metric, by a known distance: scale +- {100 * known.sigma:.1f} %; a board is more accurate"
    if built.inertial is None:
        return "metric, by the board"
    return (
        f"metric, by the inertial sensors of {built.inertial.cameras} cameras: scale "
        f"+- {100 * built.inertial.scale_sigma:.1f} %"
    )


def _vertical_line(built: BuiltMap) -> str:
    if built.inertial is not None:
        return f"z is up, by accelerometers, +- {math.degrees(built.inertial.tilt_sigma):.2f} deg"
    if built.floor is not None:
        return f"z is up, if the floor is level: {built.floor.landmarks} landmarks lie on it"
    return (
        "z is up, from the board"
        if built.reference_map.gravity_aligned
        else "z is NOT up: there is no board, and no floor beneath body cameras"
    )


@contextmanager
def _opened_source(
    arguments: argparse.Namespace, settings: MapSettings, progress: Progress
) -> Iterator[tuple[Photographs, Path | None, Sequence[KnownDistance], Mapping[str, ImuSamples]]]:
    """The photographs, the board's description, what --known-distance measures, and samples of inertial sensors.

    Frames of a recording are removed when the block ends.

    Raises:
        MapError: there is no source, or a flag that does not apply to it.
        BodycamError: the source cannot be read, or has no usable images.
    """
    source: Path | None = arguments.source
    bag: Path | None = arguments.from_bag
    known: list[KnownDistance] = []
    imus: Mapping[str, ImuSamples] = {}
    cameras: Mapping[str, MovingCamera] = {}
    photographs: Photographs | None = None
    if bag is not None:
        if source is not None:
            raise MapError(f"give either {source} or --from-bag {bag}: a map is made of one of them")
        for flag in given_flags(arguments, "camera"):
            raise MapError(
                f"{flag} cannot be used with --from-bag: the bag has the lenses of its cameras; leave it out"
            )
        rig = None if arguments.rig is None else Rig.from_yaml(arguments.rig)
        known = [_known_distance(a, b, text, rig, arguments.rig) for a, b, text in arguments.known_distance]
        needed = [camera for each in known for camera in (each.first, each.second)]
        cameras = open_body_cameras(bag, None if rig is None else tuple(rig.cameras), needed)
        imus = read_imus((bag, *arguments.imu), sorted(cameras))
        path, name = bag, bag.resolve().name
    elif (path := _existing(source)).is_file():
        camera = video_camera(path, arguments.camera)
        warn_of_mismatch(camera)
        cameras, name = {camera.name: camera}, camera.name
    else:
        photographs = find_photographs(path, arguments.camera)
    board = (path if photographs else path.resolve().parent) / BOARD_FILE
    board_path = None if arguments.no_board else arguments.board or (board if board.is_file() else None)
    # Before minutes of work, not after them.
    if not (board_path or known or imus):
        ways = "" if bag is None else ", --known-distance, or inertial sensors of its cameras (--imu BAG)"
        logger.warning(
            "the map will not be metric, so no body can be solved in it: give a board in view (--board)%s", ways
        )
    if photographs:
        yield photographs, board_path, known, imus
        return
    with scratch_folder(Path(tempfile.gettempdir())) as scratch:
        at_most = settings.frames.most
        photographs = keep_sharp_frames(cameras, scratch, name, at_most, arguments.jobs, progress)
        yield photographs, board_path, known, imus


def _existing(source: Path | None) -> Path:
    if source is None:
        raise MapError("nothing to make a map from: give REFERENCE_DIR, VIDEO or --from-bag BAG")
    if not source.exists():
        raise MapError(
            f"{source}: no such folder or file; expected a folder with photographs and camera.yaml, or a video"
        )
    if is_bag(source):
        raise MapError(f"{source}: is a bag; give it with --from-bag")
    return source


def _known_distance(first: str, second: str, text: str, rig: Rig | None, rig_path: Path) -> KnownDistance:
    """One of --known-distance.

    Raises:
        MapError: it is no number, or between cameras on different segments.
    """
    try:
        metres = float(text)
    except ValueError as error:
        raise MapError(f"--known-distance {first} {second} {text}: the last must be a number of metres") from error
    if rig and (unknown := [camera for camera in (first, second) if camera not in rig.cameras]):
        raise MapError(
            f"--known-distance {first} {second}: {rig_path} has no camera {unknown[0]}; "
            f"{other_than(unknown[0], sorted(rig.cameras))}"
        )
    if rig and rig.cameras[first] != rig.cameras[second]:
        raise MapError(
            f"--known-distance {first} {second}: by {rig_path} they are on different segments, "
            f"{rig.cameras[first]} and {rig.cameras[second]}, so their distance changes; measure one between "
            "cameras on the same segment"
        )
    return KnownDistance(first, second, metres)
