"""pycolmap's own camera object of one of ours, for the stages that hand a camera to COLMAP, and back.

COLMAP counts pixels from the corner of the image, we (like OpenCV) from the centre of the first pixel: whoever passes
pixels between the two adds or takes ``PIXEL_SHIFT``.

Whoever needs pycolmap takes it from here: the logging library within it answers SIGTERM by a stack trace once it is
loaded, so what SIGTERM meant before is put back.
"""

import signal
import threading

from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, camera_from_colmap_model, colmap_model
from bodycam_ros.camera.model import CameraModel

_before = signal.getsignal(signal.SIGTERM)

import pycolmap  # noqa: E402

if threading.current_thread() is threading.main_thread() and _before is not None:
    signal.signal(signal.SIGTERM, _before)

__all__ = ["PIXEL_SHIFT", "camera_from_colmap", "colmap_camera", "pycolmap"]

# COLMAP's log would tear the progress bars and leave files in the temporary folder. What matters comes as an exception.
for _level in pycolmap.logging.Level.__members__.values():
    pycolmap.logging.set_log_destination(_level, "")
pycolmap.logging.minloglevel = int(pycolmap.logging.Level.FATAL)


def colmap_camera(camera: CameraModel) -> pycolmap.Camera:
    """COLMAP's own camera object of one of our cameras."""
    model, parameters = colmap_model(camera)
    return pycolmap.Camera(
        model=model, width=camera.width, height=camera.height, params=parameters, has_prior_focal_length=True
    )


def camera_from_colmap(name: str, camera: pycolmap.Camera) -> CameraModel:
    """Our camera of a camera of COLMAP's.

    Raises:
        LensError: a lens model that we do not have, or parameters that no lens has.
    """
    return camera_from_colmap_model(name, camera.model_name, camera.width, camera.height, camera.params.tolist())
