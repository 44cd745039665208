"""All calls of pycolmap, whose interface changes between versions.

All pixels are shifted by half a pixel between COLMAP's convention and ours, see ``camera/colmap_model.py``.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, colmap_camera, pycolmap
from bodycam_ros.geometry import inverse
from bodycam_ros.mapping.features import ImageFeatures
from bodycam_ros.mapping.structure import Structure, distinct

_RANDOM_SEED = 1
_MAX_TRIALS = 1000  # of two-view geometry; pairs that need more have few inliers, and others tie their photographs
_SMALLEST_MODEL = 2  # photographs; COLMAP's default of 10 would refuse small sets
_PAIRS_AT_ONCE = 100  # in one call of COLMAP, which Ctrl-C waits for
_RATIO_OF_GLOBAL_ADJUSTMENTS = 1.2  # growth of the model between them; COLMAP's 1.1 costs twice the time
_COARSE_TOLERANCE = 1e-4  # relative decrease at which adjustments on the way stop; the last one goes to the end


def write_database(path: Path, camera_of_name: Mapping[str, CameraModel], features: Sequence[ImageFeatures]) -> None:
    """Create a COLMAP database with the features of all photographs, and the cameras that took them."""
    with pycolmap.Database.open(path) as database:
        cameras, camera_of_view = distinct([camera_of_name[image.name] for image in features])
        written = [_write_camera(database, camera) for camera in cameras]
        for image, row in zip(features, camera_of_view.tolist(), strict=True):
            camera_id, sensor, rig_id = written[row]
            image_id = database.write_image(pycolmap.Image(name=image.name, camera_id=camera_id))
            frame = pycolmap.Frame()
            frame.rig_id = rig_id
            frame.add_data_id(pycolmap.data_t(sensor, image_id))
            database.write_frame(frame)
            database.write_keypoints(image_id, image.pixels + np.float32(PIXEL_SHIFT))
            database.write_descriptors(
                image_id, pycolmap.FeatureDescriptors(pycolmap.FeatureExtractorType.SIFT, image.descriptors)
            )


def _write_camera(database: pycolmap.Database, camera: CameraModel) -> tuple[int, pycolmap.sensor_t, int]:
    """A camera that is a rig of its own: identifier, sensor, identifier of the rig."""
    camera_id = database.write_camera(colmap_camera(camera))
    sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_id)
    rig = pycolmap.Rig()
    rig.add_ref_sensor(sensor)
    return camera_id, sensor, database.write_rig(rig)


def reconstruct(
    database: Path, folder: Path, workers: int, on_registered: Callable[[], None]
) -> pycolmap.Reconstruction | None:
    """Incremental structure from motion with fixed intrinsics; the model with most photographs, or None.

    Args:
        database: with features and verified matches.
        folder: existing scratch folder.
        workers: threads.
        on_registered: called after each photograph that joins.
    """
    options = pycolmap.IncrementalPipelineOptions(
        num_threads=workers,
        random_seed=_RANDOM_SEED,
        min_model_size=_SMALLEST_MODEL,
        extract_colors=False,
        ba_refine_focal_length=False,
        ba_refine_principal_point=False,
        ba_refine_extra_params=False,
        ba_global_frames_ratio=_RATIO_OF_GLOBAL_ADJUSTMENTS,
        ba_global_points_ratio=_RATIO_OF_GLOBAL_ADJUSTMENTS,
        ba_local_function_tolerance=_COARSE_TOLERANCE,
        ba_global_function_tolerance=_COARSE_TOLERANCE,
    )
    options.mapper.abs_pose_refine_focal_length = False
    options.mapper.abs_pose_refine_extra_params = False
    pycolmap.set_random_seed(_RANDOM_SEED)
    models = pycolmap.incremental_mapping(
        database,
        folder,
        folder,
        options=options,
        initial_image_pair_callback=on_registered,
        next_image_callback=on_registered,
    )
    return max(models.values(), key=lambda model: model.num_reg_images(), default=None)


def keep_good_points(reconstruction: pycolmap.Reconstruction, max_error_px: float, min_angle_deg: float) -> None:
    """Drop observations and points that fail A 4.1: reprojection error, angle between rays."""
    pycolmap.ObservationManager(reconstruction).filter_all_points3D(max_error_px, min_angle_deg)


def adjust(
    reconstruction: pycolmap.Reconstruction, workers: int, outlier_px: float = 0.0, tolerance: float = 0.0
) -> None:
    """Bundle adjustment of poses and points with fixed intrinsics.

    Args:
        reconstruction: the model.
        workers: threads.
        outlier_px: observations that err by more count less and less; 0: all count by the square.
        tolerance: relative decrease of the cost at which it stops.
    """
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    options.ceres.solver_options.num_threads = workers
    options.ceres.solver_options.function_tolerance = tolerance
    if outlier_px > 0.0:
        options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
        options.ceres.loss_function_scale = outlier_px
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in reconstruction.reg_image_ids():
        config.add_image(image_id)
    for camera_id in reconstruction.cameras:
        config.set_constant_cam_intrinsics(camera_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    # Not pycolmap.bundle_adjustment: in 4.2 it turns the log on again.
    pycolmap.create_default_bundle_adjuster(options, config, reconstruction).solve()


def observations_of_points(reconstruction: pycolmap.Reconstruction, min_views: int) -> int:
    """Number of observations of the points that at least ``min_views`` photographs observe."""
    lengths = np.array([point.track.length() for point in reconstruction.points3D.values()], dtype=np.int64)
    return int(lengths[lengths >= min_views].sum())


def structure_from(reconstruction: pycolmap.Reconstruction, camera_of_name: Mapping[str, CameraModel]) -> Structure:
    """A COLMAP model as arrays; ``observation_features`` are its own rows of 2D points.

    Args:
        reconstruction: the model.
        camera_of_name: our camera of each of its photographs.
    """
    images = _registered_images(reconstruction)
    point_ids = sorted(reconstruction.points3D)
    row_of_point = {point_id: row for row, point_id in enumerate(point_ids)}
    views, points, pixels, rows = [], [], [], []
    for view, image in enumerate(images):
        for row, point2D in enumerate(image.points2D):
            if point2D.has_point3D():
                views.append(view)
                points.append(row_of_point[point2D.point3D_id])
                pixels.append(point2D.xy)
                rows.append(row)
    names = [i.name for i in images]
    cameras, camera_of_view = distinct([camera_of_name[name] for name in names])
    return Structure(
        names=names,
        cameras=cameras,
        camera_of_view=camera_of_view,
        world_T_camera=np.array(list(poses_of(reconstruction).values())).reshape(-1, 4, 4),
        points_world=np.array([reconstruction.points3D[p].xyz for p in point_ids]).reshape(-1, 3),
        colours=np.array([reconstruction.points3D[p].color for p in point_ids], dtype=np.uint8).reshape(-1, 3),
        observation_views=np.array(views, dtype=np.int64),
        observation_points=np.array(points, dtype=np.int64),
        observation_pixels=np.array(pixels, dtype=np.float64).reshape(-1, 2) - PIXEL_SHIFT,
        observation_features=np.array(rows, dtype=np.int64),
    )


def poses_of(reconstruction: pycolmap.Reconstruction) -> dict[str, NDArray[np.float64]]:
    """world_T_camera (4, 4) of every registered photograph, by its name, in their order."""
    return {
        image.name: inverse(np.vstack([image.cam_from_world().matrix(), [0.0, 0.0, 0.0, 1.0]]))
        for image in _registered_images(reconstruction)
    }


def _registered_images(reconstruction: pycolmap.Reconstruction) -> list[pycolmap.Image]:
    return sorted((i for i in reconstruction.images.values() if i.has_pose), key=lambda i: i.name)


def write_model(folder: Path, ply: Path, structure: Structure) -> None:
    """Write a structure as a COLMAP binary model with only the 2D points of landmarks, and its points as PLY.

    A landmark's id is its row; cameras and images are numbered from 1 as COLMAP does.
    """
    reconstruction = pycolmap.Reconstruction()
    for row, camera in enumerate(structure.cameras):
        sensor = colmap_camera(camera)
        sensor.camera_id = row + 1
        reconstruction.add_camera_with_trivial_rig(sensor)
    camera_T_world = inverse(structure.world_T_camera)
    tracks = [pycolmap.Track() for _ in structure.points_world]
    for view, name in enumerate(structure.names):
        seen = np.flatnonzero(structure.observation_views == view)
        image = pycolmap.Image(
            name=name,
            keypoints=structure.observation_pixels[seen] + PIXEL_SHIFT,
            camera_id=int(structure.camera_of_view[view]) + 1,
            image_id=view + 1,
        )
        reconstruction.add_image_with_trivial_frame(image, pycolmap.Rigid3d(camera_T_world[view, :3]))
        for row, point in enumerate(structure.observation_points[seen].tolist()):
            tracks[point].add_element(view + 1, row)
    for row, (xyz, colour, track) in enumerate(zip(structure.points_world, structure.colours, tracks, strict=True)):
        reconstruction.add_point3D_with_id(row, pycolmap.Point3D(xyz=xyz, color=colour, track=track))
    folder.mkdir(parents=True)
    reconstruction.write_binary(folder)
    reconstruction.export_PLY(ply)


def match_and_verify(
    database: Path, pairs: Sequence[tuple[str, str]], workers: int, on_matched: Callable[[int], None]
) -> None:
    """Match the features of each pair, and verify the matches by their epipolar geometry.

    Args:
        database: with features.
        pairs: names of photographs, without spaces.
        workers: threads.
        on_matched: called with how many more pairs are done.
    """
    listed = database.with_name("pairs.txt")
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed = _RANDOM_SEED
    options.ransac.max_num_trials = _MAX_TRIALS
    for first in range(0, len(pairs), _PAIRS_AT_ONCE):
        some = pairs[first : first + _PAIRS_AT_ONCE]
        listed.write_text("".join(f"{one} {other}\n" for one, other in some))
        pycolmap.match_image_pairs(
            database,
            pycolmap.FeatureMatchingOptions(num_threads=workers),
            pycolmap.ImportedPairingOptions(match_list_path=listed),
            options,
            pycolmap.Device.cpu,
        )
        on_matched(len(some))


def write_verified(database: Path, pairs: Sequence[tuple[str, str]], matches: Sequence[NDArray[np.uint32]]) -> None:
    """Write matches (M, 2) of each pair that are known to fit its epipolar geometry."""
    with pycolmap.Database.open(database) as opened, pycolmap.DatabaseTransaction(opened):
        ids = {image.name: image.image_id for image in opened.read_all_images()}
        for (first, second), rows in zip(pairs, matches, strict=True):
            if len(rows) == 0:
                continue
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
            geometry.inlier_matches = rows
            opened.write_two_view_geometry(ids[first], ids[second], geometry)


_JOINING_OUTLIER_PX = 1.0  # of the kernel; features agree to a third of a pixel
_FINAL_OUTLIER_PX = 0.5
_WRONG_PX = 2.0  # what errs by more once nothing pulls is no observation
_JOINING_TOLERANCE, _FINAL_TOLERANCE = 1e-3, 1e-4  # relative decrease at which it stops; more moves nothing by 0.01 mm


def complete(
    database: Path,
    photographs: Path,
    coarse: pycolmap.Reconstruction,
    min_views: int,
    min_angle_deg: float,
    workers: int,
    advance: Callable[[], None],
) -> pycolmap.Reconstruction:
    """Triangulate all that the photographs of the coarse model match, and adjust everything.

    Args:
        database: with all features of all photographs, and verified matches.
        photographs: folder of these, which give the points their colours.
        coarse: has their poses, by their names.
        min_views: of a point; others are dropped.
        min_angle_deg: least angle between two rays of a point.
        workers: threads.
        advance: called twice.
    """
    options = pycolmap.IncrementalPipelineOptions(
        num_threads=workers, random_seed=_RANDOM_SEED, ba_global_max_refinements=0
    )
    model = pycolmap.triangulate_points(coarse, database, photographs, database.parent, options=options)
    # They would cost a third of the adjustment.
    for point_id in [i for i, point in model.points3D.items() if point.track.length() < min_views]:
        model.delete_point3D(point_id)
    advance()
    # Some of what was matched along one line is wrong, so outliers must not pull before they are known.
    adjust(model, workers, _JOINING_OUTLIER_PX, _JOINING_TOLERANCE)
    keep_good_points(model, _WRONG_PX, min_angle_deg)
    adjust(model, workers, _FINAL_OUTLIER_PX, _FINAL_TOLERANCE)
    advance()
    return model
