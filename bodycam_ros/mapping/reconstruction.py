"""Structure from motion on the photographs of a reference folder, with known intrinsics."""

import errno
import logging
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import pycolmap
from bodycam_ros.errors import MapError
from bodycam_ros.files.whole_file import scratch_folder
from bodycam_ros.mapping import colmap
from bodycam_ros.mapping.epipolar_matching import match_known_poses
from bodycam_ros.mapping.features import ImageFeatures, choose_pairs, count_common_features
from bodycam_ros.mapping.photographs import wrong_camera
from bodycam_ros.mapping.structure import Structure, distinct
from bodycam_ros.progress import Progress

_LOG = logging.getLogger(__name__)

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES)

_REGISTERING_FEATURES = 700  # largest of each photograph that find the poses; with all it takes five times as long
_MOST = 0.9  # of the photographs that these must register, or all features are used; the others are left out
_MAX_ERROR_PX = 1.0  # reprojection error of a landmark, A section 4.1
_MIN_ANGLE_DEG = 2.0  # between two rays of a landmark, A section 4.1
_MIN_VIEWS = 3  # photographs: two rays always nearly meet, the third reveals a wrong match
_MIN_FITTING = 0.22  # share of the matches that must fit, or there is no map; 0.78 and more with the right camera.yaml,
# 0.19 to 0.30 with a focal length 20 % off
_DOUBTFUL_FITTING = 0.45  # share below which a warning is given; 0.13 to 0.32 with another lens model, with fx, fy 5 %
# off 0.38 in a hundred photographs, 0.7 in thirty


def reconstruct(
    folder: Path,
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    workers: int,
    progress: Progress,
) -> Structure:
    """Recover camera poses and landmarks, up to a similarity: poses from few features, landmarks from all.

    The largest features register the photographs, in a quarter of the time that all of them would take. Their poses
    predict where the others match.

    Args:
        folder: with the photographs, which give the points their colours.
        features: of the photographs.
        camera_of_name: that took each.
        workers: threads.
        progress: shows the steps.

    Raises:
        MapError: fewer than two photographs fit together, or they do so badly, as with another camera's intrinsics; or
            there is no room for temporary files.
    """
    place = Path(tempfile.gettempdir())
    with _lack_of_room_named(place), scratch_folder(place) as scratch, threadpool_limits(1, user_api="blas"):
        # COLMAP's lists of pairs take no spaces in names.
        pictures = scratch / "photographs"
        pictures.mkdir()
        name_of = {f"{row:06d}{Path(image.name).suffix}": image.name for row, image in enumerate(features)}
        for number, name in name_of.items():
            (pictures / number).symlink_to(folder.absolute() / name)
        features = [replace(image, name=number) for image, number in zip(features, name_of, strict=True)]
        camera_of_name = {number: camera_of_name[name] for number, name in name_of.items()}

        with progress.step("choosing pairs", len(features)) as advance:
            pairs = choose_pairs(count_common_features(features, workers, advance))

        coarse, registered = None, 0
        most = max(len(image.pixels) for image in features)
        for count in sorted({min(_REGISTERING_FEATURES, most), most}):
            model = _coarse_model(features, camera_of_name, pairs, count, scratch, workers, progress)
            if model is not None and model.num_reg_images() > registered:
                coarse, registered = model, model.num_reg_images()
            if registered >= _MOST * len(features):
                break
        if coarse is None or registered < 2:
            raise MapError(
                f"{registered} of {len(features)} photographs register; a map needs two or more that see the same "
                "textured things from different places. Take more of them with at least half of the view in common "
                "with the next, sharp and well lit, and check that camera.yaml belongs to the camera"
            )
        _check_fits(coarse, distinct(list(camera_of_name.values()))[0], workers)
        database = _match_in_full(features, camera_of_name, coarse, pairs, scratch, workers, progress)
        with progress.step("adjusting the bundle", 3) as advance:
            model = colmap.complete(database, pictures, coarse, _MIN_VIEWS, _MIN_ANGLE_DEG, workers, advance)
            # A 4.1
            colmap.keep_good_points(model, _MAX_ERROR_PX, _MIN_ANGLE_DEG)
            structure = colmap.structure_from(model, camera_of_name)
            advance()
    return _keep_observed(replace(structure, names=[name_of[number] for number in structure.names]))


@contextmanager
def _lack_of_room_named(place: Path) -> Iterator[None]:
    """Raise as MapError what COLMAP and the system say of a folder for temporary files that is full or cannot be used.

    Of COLMAP's database that is a RuntimeError, which may come from any call that writes.
    """
    try:
        yield
    except (RuntimeError, OSError) as error:
        in_database = isinstance(error, RuntimeError) and "database" in str(error)
        if not in_database and getattr(error, "errno", None) not in _NO_ROOM:
            raise
        raise MapError(
            f"{place}: temporary files of the map cannot be written there ({str(error).rstrip('.')}); make room, or "
            "name another place with TMPDIR"
        ) from error


def _coarse_model(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    pairs: Sequence[tuple[int, int]],
    count: int,
    scratch: Path,
    workers: int,
    progress: Progress,
) -> pycolmap.Reconstruction | None:
    """Incremental structure from motion on the ``count`` largest features of each photograph."""
    folder = scratch / f"{count}_features"
    folder.mkdir()
    database = folder / "database.db"
    largest = [image.largest(count) for image in features]
    colmap.write_database(database, camera_of_name, largest)
    with progress.step("matching pairs", len(pairs)) as advance:
        colmap.match_and_verify(database, _names(features, pairs), workers, advance)
    with progress.step("registering photographs", len(features)) as advance:
        return colmap.reconstruct(database, folder, workers, advance)


def _match_in_full(
    features: Sequence[ImageFeatures],
    camera_of_name: Mapping[str, CameraModel],
    coarse: pycolmap.Reconstruction,
    pairs: Sequence[tuple[int, int]],
    scratch: Path,
    workers: int,
    progress: Progress,
) -> Path:
    """A database of all features, with the matches of all pairs of posed photographs along epipolar lines."""
    database, poses = scratch / "database.db", colmap.poses_of(coarse)
    posed = [image for image in features if image.name in poses]
    row_of = {image.name: row for row, image in enumerate(posed)}
    known = [(row_of[a], row_of[b]) for a, b in _names(features, pairs) if a in row_of and b in row_of]
    colmap.write_database(database, camera_of_name, features)
    with progress.step("matching in full", len(known)) as advance:
        matches = match_known_poses(
            posed,
            [camera_of_name[image.name] for image in posed],
            np.array([poses[image.name] for image in posed]),
            known,
            workers,
            advance,
        )
        colmap.write_verified(database, _names(posed, known), matches)
    return database


def _names(features: Sequence[ImageFeatures], pairs: Sequence[tuple[int, int]]) -> list[tuple[str, str]]:
    return [(features[first].name, features[second].name) for first, second in pairs]


def _check_fits(model: pycolmap.Reconstruction, cameras: Sequence[CameraModel], workers: int) -> None:
    """Adjust a model, and refuse it if few of the matches fit: with wrong intrinsics only scraps do.

    Errors alone do not show it, because what errs by more than the limit is left out.
    """
    matched = colmap.observations_of_points(model, _MIN_VIEWS)
    # A 4.1, before and after: points that fail must not pull the cameras, and adjustment may uncover more of them.
    colmap.keep_good_points(model, _MAX_ERROR_PX, _MIN_ANGLE_DEG)
    colmap.adjust(model, workers)
    colmap.keep_good_points(model, _MAX_ERROR_PX, _MIN_ANGLE_DEG)
    share = colmap.observations_of_points(model, _MIN_VIEWS) / max(1, matched)
    doubt = f"only {100 * share:.0f} % of the matches between photographs fit to within {_MAX_ERROR_PX:g} px"
    if share < _MIN_FITTING:
        raise MapError(
            f"the photographs do not fit together: {doubt}, {100 * _MIN_FITTING:.0f} % are needed. "
            f"{wrong_camera(*cameras)}"
        )
    if share < _DOUBTFUL_FITTING:
        _LOG.warning("%s, so the map may be bent. %s", doubt, wrong_camera(*cameras))


def _keep_observed(structure: Structure) -> Structure:
    """Drop points that too few photographs observe."""
    kept = structure.with_points(structure.views_per_point() >= _MIN_VIEWS)
    if not len(kept.points_world):
        raise MapError(
            f"none of {len(structure.points_world)} points is observed well enough to be a landmark (error <= "
            f"{_MAX_ERROR_PX:g} px in {_MIN_VIEWS} photographs, {_MIN_ANGLE_DEG:g} deg between rays); take more "
            "photographs, from places farther apart, and check that camera.yaml belongs to the camera"
        )
    return kept
