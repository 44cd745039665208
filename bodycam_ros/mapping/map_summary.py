"""What ``map.yaml`` says beyond the map's own flags: when, from what, how and how well it was made."""

from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from bodycam_ros import __version__
from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.alignment import BoardResidual
from bodycam_ros.mapping.built_map import Registration
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.mapping.photographs import Photographs
from bodycam_ros.mapping.structure import Structure


def map_summary(
    photographs: Photographs,
    structure: Structure,
    camera: CameraModel,
    settings: MapSettings,
    residual: BoardResidual | None,
    registrations: Sequence[Registration],
) -> dict[str, Any]:
    """The document, of plain values only."""
    errors = structure.reprojection_errors(camera)
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "program": f"bodycam_ros {__version__}",
        "reference": photographs.folder.resolve().name,
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
        "board_residual": None if residual is None else asdict(residual),
        "settings": settings.as_mapping(),
        "registrations": [
            {"name": r.name, "registered": r.registered, "landmarks": r.landmarks}
            | ({"error_px": round(r.error_px, 3), "tags": r.tags} if r.registered else {})
            for r in registrations
        ],
    }
