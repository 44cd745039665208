"""The camera of a COLMAP model, for photographs that come without a calibration of their own."""

from pathlib import Path

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_camera import camera_from_colmap
from bodycam_ros.errors import LensError, MapError
from bodycam_ros.mapping import colmap

_SAME = 1e-6
"""Relative difference of parameters up to which two cameras of a model are one."""


def camera_of_model(folder: Path) -> CameraModel:
    """The one camera that took all photographs of a model.

    Raises:
        MapError: the model cannot be read, has none or several cameras, or one of a lens model that is not known.
    """
    model = colmap.read_model(folder)
    used = {image.camera_id for image in model.images.values() if image.has_pose}
    cameras = [model.cameras[camera_id] for camera_id in sorted(used)]
    if not cameras:
        raise MapError(f"{folder}: the model registers no photograph; give the folder of one that does")
    first = cameras[0]
    apart = [
        camera
        for camera in cameras
        if (camera.model_name, camera.width, camera.height) != (first.model_name, first.width, first.height)
        or not np.allclose(camera.params, first.params, rtol=_SAME, atol=_SAME)
    ]
    if apart:
        raise MapError(
            f"{folder}: the model has {len(cameras)} cameras; a map is made of photographs of one. Let COLMAP share "
            "one camera among all (ImageReader.single_camera), or put the camera_info YAML of the one that took the "
            "photographs into their folder as camera.yaml"
        )
    try:
        return camera_from_colmap("photograph", first)
    except LensError as error:
        raise MapError(
            f"{folder}: {error}; make the model with one of these lens models, or put the camera_info YAML of the "
            "camera into the photographs' folder as camera.yaml"
        ) from error
