"""All landmarks of photographs whose poses are nearly known, from matches in full; and who joins late."""

from collections.abc import Callable
from pathlib import Path

from bodycam_ros.camera.colmap_camera import pycolmap
from bodycam_ros.mapping import colmap

_RANDOM_SEED = 1
_JOINING_OUTLIER_PX = 1.0  # of the kernel; features agree to a third of a pixel
_FINAL_OUTLIER_PX = 0.5
_WRONG_PX = 2.0  # what errs by more once nothing pulls is no observation
_JOINING_TOLERANCE, _FINAL_TOLERANCE = 1e-3, 1e-4  # relative decrease at which it stops; more moves nothing by 0.01 mm


def complete(
    database: Path, coarse: pycolmap.Reconstruction, min_angle_deg: float, workers: int, advance: Callable[[], None]
) -> pycolmap.Reconstruction:
    """Triangulate all that photographs match, register those that the coarse model lacks, and adjust everything.

    Args:
        database: with all features, and verified matches.
        coarse: has the poses of most of its photographs, by their names.
        min_angle_deg: least angle between two rays of a point.
        workers: threads.
        advance: called twice.
    """
    with pycolmap.Database.open(database) as opened:
        cache = pycolmap.DatabaseCache.create(opened, pycolmap.DatabaseCacheOptions())
    model = pycolmap.Reconstruction()
    model.load(cache)
    poses = {image.name: image.cam_from_world() for image in coarse.images.values() if image.has_pose}
    for image in list(model.images.values()):
        if image.name in poses:
            model.frames[image.frame_id].rig_from_world = poses[image.name]
            model.register_frame(image.frame_id)
    mapper = pycolmap.IncrementalMapper(cache)
    mapper.begin_reconstruction(model)
    triangulation = pycolmap.IncrementalTriangulatorOptions(random_seed=_RANDOM_SEED)
    for image_id in sorted(model.reg_image_ids()):
        mapper.triangulate_image(triangulation, image_id)
    if model.num_reg_images() < model.num_images():
        _register_others(mapper, triangulation)
    mapper.complete_and_merge_tracks(triangulation)
    mapper.end_reconstruction(False)
    advance()
    # Some of what was matched along one line is wrong, so outliers must not pull before they are known.
    colmap.adjust(model, workers, _JOINING_OUTLIER_PX, _JOINING_TOLERANCE)
    colmap.keep_good_points(model, _WRONG_PX, min_angle_deg)
    colmap.adjust(model, workers, _FINAL_OUTLIER_PX, _FINAL_TOLERANCE)
    advance()
    return model


def _register_others(
    mapper: pycolmap.IncrementalMapper, triangulation: pycolmap.IncrementalTriangulatorOptions
) -> None:
    """Register the photographs that have no pose, those that see most first, as long as one succeeds."""
    options = pycolmap.IncrementalMapperOptions(
        random_seed=_RANDOM_SEED, abs_pose_refine_focal_length=False, abs_pose_refine_extra_params=False
    )
    joined = True
    while joined:
        joined = False
        for image_id in mapper.find_next_images(options, False):
            if mapper.register_next_image(options, image_id):
                mapper.triangulate_image(triangulation, image_id)
                joined = True
                break
