"""From photographs to a reference map."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.alignment import align_to_board
from bodycam_ros.mapping.apriltag import TagSettings, TagView, detect_tags
from bodycam_ros.mapping.board import Board, read_board
from bodycam_ros.mapping.built_map import BuiltMap, map_summary, registration_table
from bodycam_ros.mapping.features import FeatureSettings, ImageFeatures, extract_all, read_photograph
from bodycam_ros.mapping.known_distance import KnownDistance, measure_scale
from bodycam_ros.mapping.landmark_descriptors import choose_descriptors
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs, in_parallel
from bodycam_ros.mapping.progress import Progress, TimedProgress
from bodycam_ros.mapping.reconstruction import adopt_model, reconstruct
from bodycam_ros.mapping.small_photographs import small_photographs
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
        structure = reconstruct(features, camera_of_name, settings.pairs, settings.landmarks, workers, timed)
    else:
        structure = adopt_model(model_folder, features, camera_of_name, settings.landmarks)

    # Scale, origin and upward direction.
    alignment, known_scale = None, None
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
    if known_distances and isinstance(photographs, WornPhotographs):
        known_scale = measure_scale(structure, photographs.moments, known_distances, settings.known_distance)
        if alignment is None:
            structure = structure.transformed(known_scale.scale, np.eye(3), np.zeros(3))

    with timed.step("describing landmarks", 1) as advance:
        by_name = {image.name: image for image in features}
        seen = [by_name[name] for name in structure.names]
        chosen = choose_descriptors(structure, seen, settings.descriptors)
        advance()
    kept = None
    if settings.kept.keep:
        kept = small_photographs(photographs.folder, structure, settings.kept, workers, timed)
    registrations = registration_table([image.name for image in features], structure, tags)
    residual = None if alignment is None else alignment.residual
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
        gravity_aligned=board is not None and board.map_R_board is not None,
        photographs=kept,
        summary=map_summary(photographs, structure, settings, residual, known_scale, registrations),
    )
    return BuiltMap(reference_map, structure, registrations, residual, known_scale, timed.seconds)


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
            f"{photographs.folder}: {len(features)} of {len(photographs.paths)} photographs can be used, two or more "
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
        f"{photographs.folder}: no photograph shows a tag of the board ({board.family}: "
        f"{', '.join(map(str, board.corners_board))}) at least {settings.min_breadth:g} px broad; photograph it "
        "from near by, or leave the board out (--no-board) for a map without scale"
    )
