"""Structure from motion on the photographs of a reference folder, with known intrinsics."""

import logging
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import pycolmap
from bodycam_ros.errors import MapError
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.colmap import complete, match_in_full, write_verified, write_verified_by_colmap
from bodycam_ros.mapping.epipolar_matching import EpipolarSettings, match_known_poses
from bodycam_ros.mapping.features import ImageFeatures, PairSettings, mutual_matches, probe_overlap, promising_pairs
from bodycam_ros.mapping.map_settings import LandmarkSettings
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.progress import Progress, in_parallel
from bodycam_ros.mapping.structure import NO_FEATURE, Structure, distinct
from bodycam_ros.whole_file import scratch_folder

_LOG = logging.getLogger(__name__)

_PAIRS_AT_ONCE = 40  # between two steps of the progress bar
_SAME_FEATURE_PX = 1.5  # another detector's keypoint this near shows the same detail


def reconstruct(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    pair_settings: PairSettings,
    epipolar_settings: EpipolarSettings,
    landmark_settings: LandmarkSettings,
    workers: int,
    progress: Progress,
) -> Structure:
    """Recover camera poses and landmarks, up to a similarity: poses by few features, landmarks by all.

    The largest features register the photographs, in a quarter of the time that all of them would take. Their poses say
    where to look for the others.

    Raises:
        MapError: fewer than two photographs fit together, or they do so badly, as with another camera's intrinsics; or
            the name of one has a space in it.
    """
    if spaced := next((image.name for image in features if any(map(str.isspace, image.name))), None):
        raise MapError(f"{spaced}: COLMAP takes no pairs of photographs with spaces in their names; rename them")
    with scratch_folder(Path(tempfile.gettempdir())) as scratch, threadpool_limits(1, user_api="blas"):
        with progress.step("choosing pairs", len(features)) as advance:
            counts = []
            for row in probe_overlap(features, pair_settings, workers):
                counts.append(row)
                advance()
        pairs = promising_pairs(np.array(counts), pair_settings)

        coarse, registered = None, 0
        most = max(len(image.pixels) for image in features)
        for count in sorted({min(pair_settings.registering_features, most), most}):
            model = _coarse_model(features, camera_of_name, pairs, count, pair_settings, scratch, workers, progress)
            if model is not None and model.num_reg_images() > registered:
                coarse, registered = model, model.num_reg_images()
            if 2 * registered > len(features):
                break
        if coarse is None or registered < 2:
            raise MapError(
                f"{registered} of {len(features)} photographs register; a map needs two or more that see the same "
                "textured things from different places. Take more of them with at least half of the view in common "
                "with the next, sharp and well lit, and check that camera.yaml belongs to the camera"
            )
        _check_fits(coarse, distinct(list(camera_of_name.values()))[0], landmark_settings, workers)
        database = _matched_in_full(
            features, camera_of_name, coarse, pairs, epipolar_settings, scratch, workers, progress
        )
        with progress.step("adjusting the bundle", 3) as advance:
            model = complete(database, coarse, landmark_settings.min_angle, workers, advance)
            # A 4.1
            colmap.keep_good_points(model, landmark_settings.max_error, landmark_settings.min_angle)
            structure = colmap.structure_from(model, camera_of_name)
            advance()
    return _coloured(_keep_seen(structure, landmark_settings), features)


def _coarse_model(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    pairs: Sequence[tuple[int, int]],
    count: int,
    settings: PairSettings,
    scratch: Path,
    workers: int,
    progress: Progress,
) -> pycolmap.Reconstruction | None:
    """Incremental structure from motion on the ``count`` largest features of each photograph."""
    folder = scratch / f"{count}_features"
    folder.mkdir(exist_ok=True)
    database = folder / "database.db"
    database.unlink(missing_ok=True)
    largest = [image.largest(count) for image in features]
    colmap.write_database(database, camera_of_name, largest)
    descriptors = [image.descriptors.astype(np.float32) for image in largest]

    def match(pair: tuple[int, int]) -> NDArray[np.uint32]:
        first, second = pair
        return mutual_matches(descriptors[first], descriptors[second], settings.probe_ratio)

    matches = []
    with progress.step("matching pairs", len(pairs)) as advance:
        for found in in_parallel(match, pairs, workers):
            matches.append(found)
            advance()
        write_verified_by_colmap(database, _names(features, pairs), matches)
    with progress.step("registering photographs", len(features)) as advance:
        return colmap.reconstruct(database, folder, workers, advance)


def _matched_in_full(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    coarse: pycolmap.Reconstruction,
    pairs: Sequence[tuple[int, int]],
    settings: EpipolarSettings,
    scratch: Path,
    workers: int,
    progress: Progress,
) -> Path:
    """A database of all features with the matches of all pairs, by the poses where both are known."""
    database = scratch / "database.db"
    colmap.write_database(database, camera_of_name, features)
    poses = colmap.poses_of(coarse)
    posed = [image for image in features if image.name in poses]
    row_of = {image.name: row for row, image in enumerate(posed)}
    names = _names(features, pairs)
    known = [pair for pair in names if pair[0] in row_of and pair[1] in row_of]
    unknown = [pair for pair in names if not (pair[0] in row_of and pair[1] in row_of)]
    with progress.step("matching in full", len(pairs)) as advance:
        matches = match_known_poses(
            posed,
            [camera_of_name[image.name] for image in posed],
            np.array([poses[image.name] for image in posed]),
            [(row_of[first], row_of[second]) for first, second in known],
            settings,
            workers,
            advance,
        )
        write_verified(database, known, matches)
        for start in range(0, len(unknown), _PAIRS_AT_ONCE):
            block = unknown[start : start + _PAIRS_AT_ONCE]
            match_in_full(database, block, workers)
            advance(len(block))
    return database


def _names(features: Sequence[ImageFeatures], pairs: Sequence[tuple[int, int]]) -> list[tuple[str, str]]:
    return [(features[first].name, features[second].name) for first, second in pairs]


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


def _check_fits(
    model: pycolmap.Reconstruction, cameras: Sequence[CameraModel], settings: LandmarkSettings, workers: int
) -> None:
    """Adjust a model, and refuse it if little of what was matched fits: with wrong intrinsics only scraps do.

    Errors alone do not tell, because what errs by more than ``max_error`` is left out.
    """
    seen = colmap.observations_of_points(model, settings.min_views)
    # A 4.1, before and after: points that fail must not pull the cameras, and adjustment may uncover more of them.
    colmap.keep_good_points(model, settings.max_error, settings.min_angle)
    colmap.adjust(model, workers)
    colmap.keep_good_points(model, settings.max_error, settings.min_angle)
    share = colmap.observations_of_points(model, settings.min_views) / max(1, seen)
    if share >= max(settings.doubtful_fitting, settings.min_fitting):
        return
    doubt = (
        f"only {100 * share:.0f} % of what the photographs show in common can be explained to within "
        f"{settings.max_error:g} px"
    )
    if share >= settings.min_fitting:
        _LOG.warning("%s, so the map may be bent. %s", doubt, wrong_camera(*cameras))
        return
    raise MapError(
        f"the photographs do not fit together: {doubt}, {100 * settings.min_fitting:.0f} % are needed "
        f"(landmarks.min_fitting). {wrong_camera(*cameras)}"
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
