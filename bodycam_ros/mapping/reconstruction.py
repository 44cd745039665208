"""Structure from motion on the photographs of a reference folder, with known intrinsics."""

import logging
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.map_settings import LandmarkSettings
from bodycam_ros.mapping.pairs import PairSettings, probe_overlap, promising_pairs
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.mapping.structure import NO_FEATURE, Structure
from bodycam_ros.whole_file import scratch_folder

_LOG = logging.getLogger(__name__)

_PAIRS_AT_ONCE = 40  # between two steps of the progress bar
_SAME_FEATURE_PX = 1.5  # another detector's keypoint this near shows the same detail


def reconstruct(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    pair_settings: PairSettings,
    landmark_settings: LandmarkSettings,
    workers: int,
    progress: Progress,
) -> Structure:
    """Recover camera poses and landmarks, up to a similarity.

    Raises:
        MapError: fewer than two photographs fit together, or they do so badly, as with another camera's intrinsics.
    """
    with scratch_folder(Path(tempfile.gettempdir())) as scratch:
        database = scratch / "database.db"
        colmap.write_database(database, camera_of_name, features)

        with progress.step("choosing pairs", len(features)) as advance:
            counts = []
            for row in probe_overlap(features, pair_settings):
                counts.append(row)
                advance()
        pairs = promising_pairs(np.array(counts), pair_settings)

        with progress.step("matching pairs", len(pairs)) as advance:
            for start in range(0, len(pairs), _PAIRS_AT_ONCE):
                block = pairs[start : start + _PAIRS_AT_ONCE]
                colmap.match_pairs(database, [(features[i].name, features[j].name) for i, j in block], workers)
                advance(len(block))

        with progress.step("registering photographs", len(features)) as advance:
            model = colmap.reconstruct(database, scratch, workers, advance)
    registered = 0 if model is None else model.num_reg_images()
    if model is None or registered < 2:
        raise MapError(
            f"{registered} of {len(features)} photographs register; a map needs two or more that see the same textured "
            "things from different places. Take more of them with at least half of the view in common with the next, "
            "sharp and well lit, and check that camera.yaml belongs to the camera"
        )

    matched = colmap.structure_from(model, camera_of_name)
    with progress.step("adjusting the bundle", 2) as advance:
        # A 4.1, before and after: points that fail must not pull the cameras, and adjustment may uncover more of them.
        colmap.keep_good_points(model, landmark_settings.max_error, landmark_settings.min_angle)
        colmap.adjust(model, workers)
        advance()
        colmap.keep_good_points(model, landmark_settings.max_error, landmark_settings.min_angle)
        structure = colmap.structure_from(model, camera_of_name)
        advance()
    structure = _keep_seen(structure, landmark_settings)
    _check_fits(structure, matched, landmark_settings)
    return _coloured(structure, features)


def adopt_model(
    folder: Path,
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    settings: LandmarkSettings,
) -> Structure:
    """Take over an existing COLMAP model, with our descriptors at its observations.

    Args:
        folder: of the model's cameras, images and points3D.
        features: of all photographs; those that the model lacks are left out.
        camera_of_name: the camera of each photograph; must be those of the model.
        settings: criteria for landmarks.

    Raises:
        MapError: the model cannot be read, shows other photographs or was made with other intrinsics.
    """
    model = colmap.read_model(folder)
    colmap.keep_good_points(model, np.inf, settings.min_angle)
    known = {image.name: image for image in features}
    names = colmap.registered_names(model)
    missing = [name for name in names if name not in known]
    if missing or len(names) < 2:
        raise MapError(
            f"{folder}: the model registers {len(names)} photographs, of which {len(missing)} are not "
            f"readable in the reference folder ({', '.join(missing[:3])}...); give the folder of the model"
        )
    structure = colmap.structure_from(model, camera_of_name)
    errors = structure.reprojection_errors()
    if not len(errors) or not float(np.median(errors)) <= settings.max_model_error:
        median = float(np.median(errors)) if len(errors) else float("nan")
        raise MapError(
            f"{folder}: with the intrinsics of camera.yaml the model's points project {median:.1f} px (median) from "
            f"where they were seen, expected {settings.max_model_error:g} at most; give the calibration of the model"
        )
    structure = structure.with_observations(errors <= settings.max_error)
    structure = _linked(structure, [known[name] for name in structure.names])
    return _coloured(_keep_seen(structure, settings), features)


def _check_fits(structure: Structure, matched: Structure, settings: LandmarkSettings) -> None:
    """Refuse a structure that is a small part of what was matched: with wrong intrinsics only scraps fit together.

    Errors alone do not tell, because what errs by more than ``max_error`` has been left out.
    """
    seen = int((matched.views_per_point()[matched.observation_points] >= settings.min_views).sum())
    share = len(structure.observation_views) / max(1, seen)
    if share >= max(settings.doubtful_fitting, settings.min_fitting):
        return
    doubt = (
        f"only {100 * share:.0f} % of what the photographs show in common can be explained to within "
        f"{settings.max_error:g} px"
    )
    if share >= settings.min_fitting:
        _LOG.warning("%s, so the map may be bent. %s", doubt, wrong_camera(*structure.cameras))
        return
    raise MapError(
        f"the photographs do not fit together: {doubt}, {100 * settings.min_fitting:.0f} % are needed "
        f"(landmarks.min_fitting). {wrong_camera(*structure.cameras)}"
    )


def _linked(structure: Structure, features: Sequence[ImageFeatures]) -> Structure:
    """The structure with our nearest feature at each observation."""
    rows = np.full(len(structure.observation_views), NO_FEATURE, dtype=np.int64)
    for view, image in enumerate(features):
        here = np.flatnonzero(structure.observation_views == view)
        if len(image.pixels) and len(here):
            distances, nearest = cKDTree(image.pixels).query(structure.observation_pixels[here])
            rows[here] = np.where(distances <= _SAME_FEATURE_PX, nearest, NO_FEATURE)
    return replace(structure, observation_features=rows)


def _keep_seen(structure: Structure, settings: LandmarkSettings) -> Structure:
    """Drop points seen by too few photographs, or without any descriptor."""
    described: NDArray[np.bool_] = np.zeros(len(structure.points_world), dtype=bool)
    described[structure.observation_points[structure.observation_features != NO_FEATURE]] = True
    kept = structure.with_points(described & (structure.views_per_point() >= settings.min_views))
    if not len(kept.points_world):
        raise MapError(
            f"none of {len(structure.points_world)} points is seen well enough to be a landmark (error <= "
            f"{settings.max_error:g} px in {settings.min_views} photographs, {settings.min_angle:g} deg between rays); "
            "take more photographs, from places farther apart, and check that camera.yaml belongs to the camera"
        )
    return kept


def _coloured(structure: Structure, features: Sequence[ImageFeatures]) -> Structure:
    """The structure with the colours of the photographs' features."""
    known = {image.name: image for image in features}
    colours = np.zeros((len(structure.points_world), 3), dtype=np.uint8)
    for view, name in enumerate(structure.names):
        here = (structure.observation_views == view) & (structure.observation_features != NO_FEATURE)
        colours[structure.observation_points[here]] = known[name].colours[structure.observation_features[here]]
    return replace(structure, colours=colours)
