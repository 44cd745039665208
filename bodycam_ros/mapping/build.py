"""From photographs to a reference map."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.alignment import Floor, FloorSettings, align_to_board, find_floor
from bodycam_ros.mapping.apriltag import TagSettings, TagView, detect_tags
from bodycam_ros.mapping.board import Board, read_board
from bodycam_ros.mapping.built_map import BuiltMap, map_summary, registration_table
from bodycam_ros.mapping.features import FeatureSettings, ImageFeatures, extract_all, read_photograph
from bodycam_ros.mapping.known_distance import KnownDistance, KnownScale, measure_scale
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.progress import Progress, TimedProgress, in_parallel
from bodycam_ros.mapping.reconstruction import adopt_model, reconstruct
from bodycam_ros.mapping.small_photographs import small_photographs
from bodycam_ros.mapping.structure import Structure, choose_descriptors
from bodycam_ros.mapping.worn_keyframes import WornPhotographs
from bodycam_ros.registration.reference_map import ReferenceMap

_LOG = logging.getLogger(__name__)


def build_map(
    photographs: Photographs,
    board_path: Path | None,
    model_folder: Path | None,
    settings: MapSettings,
    workers: int,
    progress: Progress,
    known_distances: Sequence[KnownDistance] = (),
) -> BuiltMap:
    """Build a reference map (A section 4.1), metric and upright if a board is described.

    Args:
        photographs: the reference folder.
        board_path: description of the board that some photographs show; None: a map up to scale.
        model_folder: existing COLMAP model to take over; None: structure from motion.
        settings: of all steps.
        workers: threads.
        progress: shows the steps.
        known_distances: between worn cameras, of which the photographs are; they scale a map where no board does.

    Raises:
        MapError: the photographs do not make a map, or do not show the board.
    """
    board = None if board_path is None else read_board(board_path)
    timed = TimedProgress(progress)
    camera_of_name = photographs.camera_of_name

    # Features, with the detector that body cameras use.
    features = _features(photographs, settings.features, workers, timed)
    # Before the minutes of structure from motion: a board that nobody sees should cost seconds.
    tags = {} if board is None else _tag_views(photographs, features, board, settings.tags, workers, timed)
    if board is not None and not any(tags.values()):
        problem = _no_tag(photographs, board, settings.tags)
        if not known_distances:
            raise MapError(problem)
        _LOG.warning("%s. The known distance alone scales the map", problem)
        board = None
    # Poses and points, kept by the criteria of A 4.1.
    if model_folder is None:
        structure = reconstruct(
            features, camera_of_name, settings.pairs, settings.epipolar, settings.landmarks, workers, timed
        )
    else:
        structure = adopt_model(model_folder, features, camera_of_name, settings.landmarks)

    # Scale, origin and upward direction.
    alignment, known_scale, floor = None, None, None
    if board is not None:
        tag_views, taken_by = zip(*((tags[name], camera_of_name[name]) for name in structure.names), strict=True)
        alignment = align_to_board(structure.world_T_camera, tag_views, taken_by, board, settings.alignment)
        structure = structure.transformed(alignment.scale, alignment.R, alignment.t)
        if board.map_R_board is None:
            _LOG.warning(
                "%s: 'placement' does not say which axis of the board is up (as in 'lying: board z is up'); "
                "the map is metric, but its z is the board's, not up",
                board_path,
            )
    if isinstance(photographs, WornPhotographs):
        if known_distances:
            known_scale = measure_scale(structure, photographs.moments, known_distances, settings.known_distance)
        if alignment is None:
            structure, floor = _by_wearer(structure, photographs, known_scale, settings.floor)

    with timed.step("describing landmarks", 1) as advance:
        by_name = {image.name: image for image in features}
        seen = [by_name[name] for name in structure.names]
        chosen = choose_descriptors(structure, seen, settings.descriptors)
        advance()
    kept = None
    if settings.kept.keep:
        kept = small_photographs(photographs.folder, structure, workers, timed)
    registrations = registration_table([image.name for image in features], structure, tags)
    residual, map_R_board = (None, None) if alignment is None else (alignment.residual, alignment.map_R_board)
    reference_map = ReferenceMap(
        landmark_ids=np.arange(len(structure.points_world), dtype=np.uint32),
        points_world=structure.points_world,
        colours=structure.colours,
        descriptor_landmark=chosen.landmark,
        descriptors=chosen.descriptors,
        descriptor_view=chosen.view,
        descriptor_size=chosen.size,
        world_T_camera=structure.world_T_camera,
        image_names=tuple(structure.names),
        metric=alignment is not None or known_scale is not None,
        gravity_aligned=floor is not None or (board is not None and board.map_R_board is not None),
        photographs=kept,
        summary=map_summary(photographs, structure, settings, residual, known_scale, floor, registrations, map_R_board),
    )
    return BuiltMap(reference_map, structure, registrations, residual, known_scale, floor, timed.seconds)


def _by_wearer(
    structure: Structure, photographs: WornPhotographs, known_scale: KnownScale | None, settings: FloorSettings
) -> tuple[Structure, Floor | None]:
    """Put a structure on the floor beneath the wearer, in metres if a distance is known; says how far to trust it."""
    scale = 1.0
    if known_scale is None:
        _LOG.warning("no board is seen and no distance is known, so the map has no scale; see --known-distance")
    else:
        scale = known_scale.scale
        _LOG.warning(
            "the map's scale comes from known distances alone: all lengths may be wrong by %.1f %% (1 sigma). A board "
            "on the floor, or a longer distance, makes that less",
            100.0 * known_scale.sigma,
        )
    floor = find_floor(structure, photographs.moments, settings)
    if floor is None:
        _LOG.warning("no floor is found beneath the worn cameras, so the map's z is not up; let a board lie there")
        return structure.transformed(scale, np.eye(3), np.zeros(3)), None
    _LOG.warning("the map's z is up if the floor is level on which its wearer stood")
    turned = scale * floor.map_R_world
    return structure.transformed(scale, floor.map_R_world, -turned @ floor.origin), floor


def _features(
    photographs: Photographs, settings: FeatureSettings, workers: int, progress: Progress
) -> list[ImageFeatures]:
    """Features of all photographs that can be read and belong to the camera; the others are warned about."""
    features: list[ImageFeatures] = []
    skipped = []
    with progress.step("extracting features", len(photographs.paths)) as advance:
        for result in extract_all(photographs.paths, photographs.camera_of_name, settings, workers):
            if isinstance(result, MapError):
                _LOG.warning("skipped: %s", result)
                skipped.append(result)
            else:
                features.append(result)
            advance()
    if len(features) < 2:
        raise MapError(
            f"{photographs.where}: {len(features)} of {len(photographs.paths)} photographs can be used, two or more "
            f"are needed; the first that cannot: {skipped[0]}"
        )
    return features


def _tag_views(
    photographs: Photographs,
    features: Sequence[ImageFeatures],
    board: Board,
    settings: TagSettings,
    workers: int,
    progress: Progress,
) -> dict[str, list[TagView]]:
    """Photograph -> the board's tags that it measures."""

    def detect(name: str) -> list[TagView]:
        picture, camera = read_photograph(photographs.folder / name), photographs.camera_of_name[name]
        views = detect_tags(picture, camera, board.family, settings)
        return [view for view in views if view.tag in board.corners_board]

    names = [image.name for image in features]
    tags = {}
    with progress.step("measuring the board", len(names)) as advance:
        for name, views in zip(names, in_parallel(detect, names, workers), strict=True):
            tags[name] = views
            advance()
    return tags


def _no_tag(photographs: Photographs, board: Board, settings: TagSettings) -> str:
    return (
        f"{photographs.where}: no photograph shows a tag of the board ({board.family}: "
        f"{', '.join(map(str, board.corners_board))}) at least {settings.min_breadth:g} px broad; photograph it "
        "from near by, or leave the board out (--no-board) for a map without scale"
    )
