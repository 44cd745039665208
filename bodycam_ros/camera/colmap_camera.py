"""pycolmap's own camera object of one of ours, for the stages that hand a camera to COLMAP.

COLMAP counts pixels from the corner of the image, we (like OpenCV) from the centre of the first pixel: whoever passes
pixels between the two adds or takes ``PIXEL_SHIFT``.
"""

from bodycam_ros.camera.colmap_library import pycolmap
from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, colmap_model
from bodycam_ros.camera.model import CameraModel

__all__ = ["PIXEL_SHIFT", "colmap_camera"]

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
