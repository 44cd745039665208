"""Matches of ours in a database of COLMAP: to be verified by it, or known to fit the poses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.colmap_camera import pycolmap

_RANDOM_SEED = 1

Names = Sequence[tuple[str, str]]
"""Pairs of photographs."""


def write_verified_by_colmap(database: Path, pairs: Names, matches: Sequence[NDArray[np.uint32]]) -> None:
    """Write matches (M, 2) of each pair, and those of them that share an epipolar geometry."""
    with pycolmap.Database.open(database) as opened, pycolmap.DatabaseTransaction(opened):
        ids = _ids(opened)
        for (first, second), rows in zip(pairs, matches, strict=True):
            opened.write_matches(ids[first], ids[second], rows)
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed = _RANDOM_SEED
    pycolmap.verify_matches(database, list_pairs(database, pairs), options)


def write_verified(database: Path, pairs: Names, matches: Sequence[NDArray[np.uint32]]) -> None:
    """Write matches (M, 2) of each pair that are known to fit its epipolar geometry."""
    with pycolmap.Database.open(database) as opened, pycolmap.DatabaseTransaction(opened):
        ids = _ids(opened)
        for (first, second), rows in zip(pairs, matches, strict=True):
            if len(rows) == 0:
                continue
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
            geometry.inlier_matches = rows
            opened.write_two_view_geometry(ids[first], ids[second], geometry)


def match_in_full(database: Path, pairs: Names, workers: int) -> None:
    """Let COLMAP match pairs of photographs in full, and verify them by their epipolar geometry."""
    pycolmap.match_image_pairs(
        database,
        matching_options=pycolmap.FeatureMatchingOptions(num_threads=workers, use_gpu=False),
        pairing_options=pycolmap.ImportedPairingOptions(match_list_path=list_pairs(database, pairs)),
    )


def list_pairs(database: Path, pairs: Names) -> Path:
    """Write pairs of photographs as COLMAP reads them, beside the database."""
    path = database.with_name("pairs.txt")
    path.write_text("".join(f"{first} {second}\n" for first, second in pairs))
    return path


def _ids(database: pycolmap.Database) -> dict[str, int]:
    return {image.name: image.image_id for image in database.read_all_images()}
