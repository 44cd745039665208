"""A camera as COLMAP names and orders it. COLMAP's pixels have the centre of the top left pixel at (0.5, 0.5).

COLMAP counts pixels from the corner of the image, we (like OpenCV) from the centre of the first pixel: whoever passes
pixels between the two adds or takes ``PIXEL_SHIFT``.

Whoever needs pycolmap takes it from here: the logging library within it answers SIGTERM by a stack trace once it is
loaded, so what SIGTERM meant before is put back.
"""

import signal
import threading

import pycolmap  # noqa: E402

from bodycam_ros.camera.model import CameraModel

PIXEL_SHIFT = 0.5  # [px]
_NAMES = {"plumb_bob": "OPENCV", "rational_polynomial": "FULL_OPENCV", "equidistant": "OPENCV_FISHEYE", "fov": "FOV"}


def colmap_model(camera: CameraModel) -> tuple[str, list[float]]:
    """COLMAP's model name and parameters of a camera; a plumb_bob with k3 becomes FULL_OPENCV."""
    name = _NAMES[camera.distortion_model]
    distortion = list(camera.distortion)
    if name == "OPENCV":
        if distortion[4] == 0.0:
            distortion = distortion[:4]
        else:
            name, distortion = "FULL_OPENCV", [*distortion, 0.0, 0.0, 0.0]
    return name, [camera.fx, camera.fy, camera.cx + PIXEL_SHIFT, camera.cy + PIXEL_SHIFT, *distortion]


_before = signal.getsignal(signal.SIGTERM)


if threading.current_thread() is threading.main_thread() and _before is not None:
    signal.signal(signal.SIGTERM, _before)

__all__ = ["PIXEL_SHIFT", "colmap_camera", "pycolmap"]

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
