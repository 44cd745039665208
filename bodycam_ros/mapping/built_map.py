"""A map that is ready to be saved, with what a person wants to know before trusting it, there and in ``map.yaml``."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros import __version__
from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.alignment import BoardResidual, Floor
from bodycam_ros.mapping.apriltag import TagView
from bodycam_ros.mapping.known_distance import KnownScale
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.structure import Structure, write_ply
from bodycam_ros.registration.reference_map import MAP_R_BOARD, ReferenceMap

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
        registrations: one per readable photograph.
        residual: of the board; None without one.
        known_scale: by known distances, or what they make of a map that the board has scaled; None without any.
        floor: that says what is up, where no board does.
        seconds: step -> time that it took.
    """

    reference_map: ReferenceMap
    structure: Structure
    registrations: tuple[Registration, ...]
    residual: BoardResidual | None
    known_scale: KnownScale | None
    floor: Floor | None
    seconds: dict[str, float]

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
            colmap.write_model(folder / _MODEL_FOLDER, self.structure)
            write_ply(folder / _PLY_FILE, self.structure)
            also(folder)

        self.reference_map.save(path, force=force, also=write_structure)


def registration_table(
    names: Sequence[str], structure: Structure, tags: Mapping[str, Sequence[TagView]]
) -> tuple[Registration, ...]:
    """What became of each of the photographs ``names``, in their order."""
    errors = structure.reprojection_errors()
    view_of = {name: view for view, name in enumerate(structure.names)}
    registrations = []
    for name in names:
        view = view_of.get(name)
        if view is None:
            registrations.append(Registration(name, False, 0, float("nan"), 0))
            continue
        seen = errors[structure.observation_views == view]
        error = float(seen.mean()) if len(seen) else float("nan")
        registrations.append(Registration(name, True, len(seen), error, len(tags.get(name, ()))))
    return tuple(registrations)


def map_summary(
    photographs: Photographs,
    structure: Structure,
    settings: MapSettings,
    residual: BoardResidual | None,
    known_scale: KnownScale | None,
    floor: Floor | None,
    registrations: Sequence[Registration],
    map_R_board: NDArray[np.float64] | None,
) -> dict[str, Any]:
    """The document, of plain values only."""
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
        **_cameras_summary(structure.cameras),
        "board_residual": None if residual is None else asdict(residual),
        MAP_R_BOARD: None if map_R_board is None else map_R_board.tolist(),
        "known_distance": None if known_scale is None else known_scale.as_mapping(),
        "floor": None if floor is None else {"landmarks": floor.landmarks, "tilt_sigma_deg": floor.tilt_sigma_deg},
        "settings": settings.as_mapping(),
        "registrations": [
            {"name": r.name, "registered": r.registered, "landmarks": r.landmarks}
            | ({"error_px": round(r.error_px, 3), "tags": r.tags} if r.registered else {})
            for r in registrations
        ],
    }


def _cameras_summary(cameras: Sequence[CameraModel]) -> dict[str, Any]:
    documents = [
        {
            "distortion_model": camera.distortion_model,
            "size": [camera.width, camera.height],
            "k": [camera.fx, camera.fy, camera.cx, camera.cy],
            "d": list(camera.distortion),
        }
        for camera in cameras
    ]
    if len(cameras) == 1:
        return {"camera": documents[0]}
    return {"cameras": {camera.name: document for camera, document in zip(cameras, documents, strict=True)}}
