"""From a folder of photographs to a reference map."""

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.alignment import BoardAlignment, BoardResidual, align_to_board
from bodycam_ros.mapping.apriltag import TagSettings, TagView, detect_tags
from bodycam_ros.mapping.board import Board, read_board
from bodycam_ros.mapping.features import FeatureSettings, ImageFeatures, extract_all, read_photograph
from bodycam_ros.mapping.landmark_descriptors import choose_descriptors
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.progress import Advance, Progress
from bodycam_ros.mapping.reconstruction import adopt_model, reconstruct
from bodycam_ros.mapping.reference_map import ReferenceMap
from bodycam_ros.mapping.structure import Structure
from bodycam_ros.mapping.structure_ply import write_ply

_LOG = logging.getLogger(__name__)
_MODEL_FOLDER = "sparse"
_PLY_FILE = "structure.ply"


@dataclass(frozen=True)
class Registration:
    """What became of one photograph.

    Attributes:
        name: its file name.
        registered: whether its pose is known.
        landmarks: how many it sees.
        error_px: mean reprojection error of those; NaN without any.
        tags: how many tags of the board it measures.
    """

    name: str
    registered: bool
    landmarks: int
    error_px: float
    tags: int


@dataclass(frozen=True)
class BuiltMap:
    """A map that is ready to be saved, and what a person wants to know about it.

    Attributes:
        reference_map: landmarks, descriptors, poses.
        structure: the same with all observations, in the map frame.
        camera: of the photographs.
        registrations: one per readable photograph.
        residual: of the board; None without one.
        seconds: step -> time that it took.
    """

    reference_map: ReferenceMap
    structure: Structure
    camera: CameraModel
    registrations: tuple[Registration, ...]
    residual: BoardResidual | None
    seconds: dict[str, float]

    def save(self, path: Path, *, force: bool = False) -> None:
        """Write the map folder with its COLMAP model and PLY, whole or not at all.

        Raises:
            MapError: the folder exists already, or cannot be written.
        """

        def write_structure(folder: Path) -> None:
            colmap.write_model(folder / _MODEL_FOLDER, self.structure, self.camera)
            write_ply(folder / _PLY_FILE, self.structure)

        self.reference_map.save(path, force=force, also=write_structure)


def build_map(
    photographs: Photographs,
    board_path: Path | None,
    model_folder: Path | None,
    settings: MapSettings,
    workers: int,
    progress: Progress,
) -> BuiltMap:
    """Build a reference map (A section 4.1), metric and upright if a board is described.

    Args:
        photographs: the reference folder.
        board_path: description of the board that some photographs show; None: a map up to scale.
        model_folder: existing COLMAP model to take over; None: structure from motion.
        settings: of all steps.
        workers: threads.
        progress: shows the steps.

    Raises:
        MapError: the photographs do not make a map, or do not show the board.
    """
    board = None if board_path is None else read_board(board_path)
    timed = _Timed(progress)
    camera = photographs.camera

    features = _features(photographs, settings.features, workers, timed)
    # Before the minutes of structure from motion: a board that nobody sees should cost seconds.
    tags = {} if board is None else _tag_views(photographs, features, board, settings.tags, workers, timed)
    if model_folder is None:
        structure = reconstruct(features, camera, settings.pairs, settings.landmarks, workers, timed)
    else:
        structure = adopt_model(model_folder, features, camera, settings.landmarks)

    alignment = None
    if board is not None:
        tag_views = [tags[name] for name in structure.names]
        alignment = align_to_board(structure.world_T_camera, tag_views, camera, board, settings.alignment)
        structure = structure.transformed(alignment.scale, alignment.R, alignment.t)
        if board.map_R_board is None:
            _LOG.warning(
                "%s: 'placement' does not say which axis of the board is up (as in 'lying: board z is up'); "
                "the map is metric, but its z is the board's, not up",
                board_path,
            )

    with timed.step("describing landmarks", 1) as advance:
        by_name = {image.name: image for image in features}
        seen = [by_name[name] for name in structure.names]
        chosen = choose_descriptors(structure, seen, camera, settings.descriptors)
        advance()
    registrations = _registrations(features, structure, camera, tags)
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
        metric=alignment is not None,
        gravity_aligned=board is not None and board.map_R_board is not None,
        summary=_summary(photographs, structure, camera, settings, alignment, registrations),
    )
    return BuiltMap(reference_map, structure, camera, registrations, residual, timed.seconds)


def _features(
    photographs: Photographs, settings: FeatureSettings, workers: int, progress: Progress
) -> list[ImageFeatures]:
    """Features of all photographs that can be read and belong to the camera; the others are warned about."""
    features: list[ImageFeatures] = []
    skipped = []
    with progress.step("extracting features", len(photographs.paths)) as advance:
        for result in extract_all(photographs.paths, photographs.camera, settings, workers):
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
        views = detect_tags(read_photograph(photographs.folder / name), photographs.camera, board.family, settings)
        return [view for view in views if view.tag in board.corners_board]

    names = [image.name for image in features]
    tags = {}
    with progress.step("measuring the board", len(names)) as advance, ThreadPoolExecutor(workers) as pool:
        for name, views in zip(names, pool.map(detect, names), strict=True):
            tags[name] = views
            advance()
    if not any(tags.values()):
        raise MapError(
            f"{photographs.folder}: no photograph shows a tag of the board ({board.family}: "
            f"{', '.join(map(str, board.corners_board))}) at least {settings.min_breadth:g} px broad; photograph it "
            "from near by, or leave the board out (--no-board) for a map without scale"
        )
    return tags


def _registrations(
    features: Sequence[ImageFeatures], structure: Structure, camera: CameraModel, tags: Mapping[str, Sequence[TagView]]
) -> tuple[Registration, ...]:
    errors = structure.reprojection_errors(camera)
    view_of = {name: view for view, name in enumerate(structure.names)}
    registrations = []
    for image in features:
        view = view_of.get(image.name)
        if view is None:
            registrations.append(Registration(image.name, False, 0, float("nan"), 0))
            continue
        seen = errors[structure.observation_views == view]
        error = float(seen.mean()) if len(seen) else float("nan")
        registrations.append(Registration(image.name, True, len(seen), error, len(tags.get(image.name, ()))))
    return tuple(registrations)


def _summary(
    photographs: Photographs,
    structure: Structure,
    camera: CameraModel,
    settings: MapSettings,
    alignment: BoardAlignment | None,
    registrations: Sequence[Registration],
) -> dict[str, Any]:
    """What ``map.yaml`` says beyond the map's own flags."""
    errors = structure.reprojection_errors(camera)
    return {
        "photographs": len(photographs.paths),
        "registered": len(structure.names),
        "landmarks": len(structure.points_world),
        "observations": len(errors),
        "mean_reprojection_error_px": round(float(errors.mean()), 4),
        "camera": {
            "distortion_model": camera.distortion_model,
            "size": [camera.width, camera.height],
            "k": [camera.fx, camera.fy, camera.cx, camera.cy],
            "d": list(camera.distortion),
        },
        "board_residual": None if alignment is None else asdict(alignment.residual),
        "settings": settings.as_mapping(),
        "registrations": [
            {"name": r.name, "registered": r.registered, "landmarks": r.landmarks}
            | ({"error_px": round(r.error_px, 3), "tags": r.tags} if r.registered else {})
            for r in registrations
        ],
    }


class _Timed:
    """Progress that also takes the time of each step."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self.seconds: dict[str, float] = {}

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        """Pass the step on and note its time."""
        start = time.monotonic()
        with self._progress.step(name, total) as advance:
            yield advance
        self.seconds[name] = time.monotonic() - start
