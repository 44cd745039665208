"""From photographs to a reference map."""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from bodycam_ros import __version__
from bodycam_ros.boards.apriltag import TagView
from bodycam_ros.boards.board import Board, read_board
from bodycam_ros.errors import MapError
from bodycam_ros.files.shown import few
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.inertial.map_alignment import InertialAlignment, RegisteredPoses, align_to_gravity
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.board_alignment import BoardAlignment, BoardResidual, align_to_board
from bodycam_ros.mapping.features import ImageFeatures, extract_all
from bodycam_ros.mapping.floor import Floor, body_extent, stand_on_floor
from bodycam_ros.mapping.known_distance import KnownDistance, KnownScale, measure_scale
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.reconstruction import reconstruct
from bodycam_ros.mapping.small_photographs import small_photographs
from bodycam_ros.mapping.structure import Structure, choose_descriptors
from bodycam_ros.progress import Progress
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.reference_map import MAP_R_BOARD, ReferenceMap

_LOG = logging.getLogger(__name__)

_BODY_EXTENT_M = 1.4  # between the farthest body cameras, roughly
_MODEL_FOLDER = "sparse"
_PLY_FILE = "structure.ply"


@dataclass(frozen=True)
class BuiltMap:
    """A map that is ready to be saved, with its quality.

    Attributes:
        reference_map: landmarks, descriptors, poses.
        structure: the same with all observations, in the map frame.
        observed: readable photograph -> how many landmarks it observes; None of one that is not registered.
        residual: of the board; None without one.
        known_scale: by known distances, or of known distances in a map that the board has scaled; None without any.
        floor: that gives the origin, and the vertical where no sensor does; None with a board, or if there is none.
        inertial: scale and vertical by inertial sensors; None without any.
    """

    reference_map: ReferenceMap
    structure: Structure
    observed: Mapping[str, int | None]
    residual: BoardResidual | None
    known_scale: KnownScale | None
    floor: Floor | None
    inertial: InertialAlignment | None

    def save(self, path: Path, *, force: bool = False, also: Callable[[Path], None] = lambda folder: None) -> None:
        """Write the map folder with its COLMAP model and PLY, whole or not at all.

        Args:
            path: folder to create.
            force: replace a map that is there.
            also: writes further files into the folder that it is given, before the folder appears.

        Raises:
            MapError: the folder exists already.
            OutputError: it cannot be written.
        """

        def write_structure(folder: Path) -> None:
            colmap.write_model(folder / _MODEL_FOLDER, folder / _PLY_FILE, self.structure)
            also(folder)

        self.reference_map.save(path, force=force, also=write_structure)


def build_map(
    photographs: Photographs,
    board_path: Path | None,
    settings: MapSettings,
    workers: int,
    progress: Progress,
    known_distances: Sequence[KnownDistance] = (),
    imus: Mapping[str, ImuSamples] = MappingProxyType({}),
    register: Callable[[ReferenceMap, Collection[str]], Mapping[str, RegisteredPoses]] = lambda *of: {},
) -> BuiltMap:
    """Build a reference map (A section 4.1), metric and upright if a board is described.

    Args:
        photographs: the reference folder.
        board_path: description of the board that some photographs show; None: a map up to scale.
        settings: of all steps.
        workers: threads.
        progress: shows the steps.
        known_distances: between body cameras, of which the photographs are; they scale a map where no board does.
        imus: body camera -> samples of its inertial sensor; they give scale and vertical where no board does.
        register: registers all images of some body cameras in a map.

    Raises:
        MapError: the photographs do not make a map, or do not show the board.
    """
    board = None if board_path is None else read_board(board_path)
    camera_of_name = photographs.camera_of_name

    # Features, with the detector that body cameras use.
    features, tags = _features(photographs, settings.features.max_features, board, workers, progress)
    # Before structure from motion: a board that no photograph shows should cost seconds.
    if board is not None and not any(tags.values()):
        problem = (
            f"{photographs.where}: no photograph shows a tag of the board ({board.family}: "
            f"{', '.join(map(str, board.corners_board))}) large enough; photograph it from near by, or leave the board "
            "out (--no-board) for a map without scale"
        )
        if not known_distances and not imus:
            raise MapError(problem)
        _LOG.warning("%s. The known distance or inertial sensors scale the map", problem)
        board = None
    # Poses and points, kept by the criteria of A 4.1.
    structure = reconstruct(photographs.folder, features, camera_of_name, workers, progress)

    # Scale, origin and upward direction.
    alignment = None
    known_scale = None
    floor = None
    inertial = None
    if board is not None:
        tag_views, taken_by = zip(*((tags[name], camera_of_name[name]) for name in structure.names), strict=True)
        alignment = align_to_board(structure.world_T_camera, tag_views, taken_by, board)
        structure = structure.transformed(alignment.scale, alignment.R, alignment.t)
        if board.map_R_board is None:
            _LOG.warning(
                "%s: 'placement' does not name the axis of the board that is up (as in 'lying: board z is up'); "
                "the map is metric, but its z is the board's, not up",
                board_path,
            )
    sensors = {} if alignment is not None else imus
    if known_distances or sensors:
        if alignment is None:
            structure = structure.transformed(_BODY_EXTENT_M / body_extent(structure)[1], np.eye(3), np.zeros(3))
        measuring = {*sensors, *(camera for each in known_distances for camera in (each.first, each.second))}
        with progress.step("registering images for the scale", 1) as advance:
            unscaled = _make_map(structure, features, None, metric=True, gravity_aligned=False, summary={})
            poses = register(unscaled, sorted(measuring))
            advance()
        known_scale = measure_scale(poses, known_distances) if known_distances else None
        inertial = align_to_gravity(poses, sensors) if sensors else None
    if alignment is None:
        if (scaled := known_scale or inertial) is not None:
            structure = structure.transformed(scaled.scale, np.eye(3), np.zeros(3))
        structure, floor = stand_on_floor(structure, None if inertial is None else inertial.up)

    kept = small_photographs(photographs.folder, structure, workers, progress)
    with progress.step("describing landmarks", 1) as advance:
        counts = np.bincount(structure.observation_views, minlength=len(structure.names)).tolist()
        observed = dict.fromkeys(image.name for image in features) | dict(zip(structure.names, counts, strict=True))
        reference_map = _make_map(
            structure,
            features,
            kept,
            metric=alignment is not None or known_scale is not None or inertial is not None,
            gravity_aligned=inertial is not None
            or floor is not None
            or (board is not None and board.map_R_board is not None),
            summary=_summary(photographs, structure, settings, alignment, known_scale, floor, inertial),
        )
        advance()
    residual = None if alignment is None else alignment.residual
    return BuiltMap(reference_map, structure, observed, residual, known_scale, floor, inertial)


def _make_map(
    structure: Structure,
    features: Sequence[ImageFeatures],
    photographs: MapPhotographs | None,
    *,
    metric: bool,
    gravity_aligned: bool,
    summary: Mapping[str, Any],
) -> ReferenceMap:
    """The map of a structure, in its frame."""
    by_name = {image.name: image for image in features}
    return ReferenceMap(
        landmark_ids=np.arange(len(structure.points_world), dtype=np.uint32),
        points_world=structure.points_world,
        colours=structure.colours,
        **choose_descriptors(structure, [by_name[name] for name in structure.names]),
        world_T_camera=structure.world_T_camera,
        image_names=tuple(structure.names),
        metric=metric,
        gravity_aligned=gravity_aligned,
        photographs=photographs,
        summary=summary,
    )


def _features(
    photographs: Photographs, max_features: int, board: Board | None, workers: int, progress: Progress
) -> tuple[list[ImageFeatures], dict[str, list[TagView]]]:
    """Features, and tags of the board by name, of all photographs that can be used; the others are warned about."""
    features: list[ImageFeatures] = []
    tags: dict[str, list[TagView]] = {}
    skipped = []
    family = None if board is None else board.family
    with progress.step("extracting features", len(photographs.paths)) as advance:
        for result in extract_all(photographs.paths, photographs.camera_of_name, max_features, family, workers):
            if isinstance(result, MapError):
                skipped.append(result)
            else:
                features.append(result[0])
                known = () if board is None else board.corners_board
                tags[result[0].name] = [view for view in result[1] if view.tag in known]
            advance()
    if len(features) < 2:
        raise MapError(
            f"{photographs.where}: {len(features)} of {len(photographs.paths)} photographs can be used, two or more "
            f"are needed; the first that cannot: {skipped[0]}"
        )
    if skipped:
        _LOG.warning("%d of %d photographs are not used: %s", len(skipped), len(photographs.paths), few(skipped))
    return features, tags


def _summary(
    photographs: Photographs,
    structure: Structure,
    settings: MapSettings,
    alignment: BoardAlignment | None,
    known_scale: KnownScale | None,
    floor: Floor | None,
    inertial: InertialAlignment | None,
) -> dict[str, Any]:
    """What ``map.yaml`` documents, as plain values."""
    errors = structure.reprojection_errors()
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "program": f"bodycam_ros {__version__}",
        "reference": photographs.name,
        "photographs": len(photographs.paths),
        "registered": len(structure.names),
        "landmarks": len(structure.points_world),
        "observations": len(errors),
        "mean_reprojection_error_px": round(float(errors.mean()), 4),
        "cameras": {
            camera.name: {
                "distortion_model": camera.distortion_model,
                "size": [camera.width, camera.height],
                "k": [camera.fx, camera.fy, camera.cx, camera.cy],
                "d": list(camera.distortion),
            }
            for camera in structure.cameras
        },
        "board_residual": None if alignment is None else asdict(alignment.residual),
        MAP_R_BOARD: None if alignment is None else alignment.map_R_board.tolist(),
        "known_distance": known_scale
        and {"relative_sigma": round(known_scale.sigma, 5), "distances": list(known_scale.summary)},
        "floor_landmarks": floor and floor.landmarks,
        "inertial": inertial
        and {
            "relative_scale_sigma": round(inertial.scale_sigma, 5),
            "tilt_sigma_deg": round(float(np.degrees(inertial.tilt_sigma)), 4),
            "cameras": inertial.cameras,
        },
        "settings": settings.as_mapping(),
    }
