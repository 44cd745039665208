"""A camera as COLMAP names and orders it. COLMAP's pixels have the centre of the top left pixel at (0.5, 0.5).

COLMAP counts pixels from the corner of the image, we (like OpenCV) from the centre of the first pixel: whoever passes
pixels between the two adds or takes ``PIXEL_SHIFT``.

Whoever needs pycolmap takes it from here: the logging library within it answers SIGTERM by a stack trace once it is
loaded, so what SIGTERM meant before is put back.
"""

import signal
import threading
from collections.abc import Sequence

import pycolmap  # noqa: E402

from bodycam_ros.camera.camera_info import camera_from_info
from bodycam_ros.camera.model import CameraModel
from bodycam_ros.errors import LensError

PIXEL_SHIFT = 0.5  # [px]
_NAMES = {"plumb_bob": "OPENCV", "rational_polynomial": "FULL_OPENCV", "equidistant": "OPENCV_FISHEYE", "fov": "FOV"}

_FORMS = {
    "SIMPLE_PINHOLE": ("plumb_bob", 1, 5),
    "PINHOLE": ("plumb_bob", 2, 5),
    "SIMPLE_RADIAL": ("plumb_bob", 1, 5),
    "RADIAL": ("plumb_bob", 1, 5),
    "OPENCV": ("plumb_bob", 2, 5),
    "FULL_OPENCV": ("rational_polynomial", 2, 8),
    "SIMPLE_FISHEYE": ("equidistant", 1, 4),
    "FISHEYE": ("equidistant", 2, 4),
    "SIMPLE_RADIAL_FISHEYE": ("equidistant", 1, 4),
    "RADIAL_FISHEYE": ("equidistant", 1, 4),
    "OPENCV_FISHEYE": ("equidistant", 2, 4),
    "FOV": ("fov", 2, 1),
}
"""COLMAP's model -> ours, how many focal lengths COLMAP counts, and how many coefficients we do; COLMAP's come in the
same order and stop earlier."""


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


def camera_from_colmap_model(
    name: str, model: str, width: int, height: int, parameters: Sequence[float]
) -> CameraModel:
    """Our camera of COLMAP's model name and parameters.

    Args:
        name: of the camera, for messages.
        model: as COLMAP names it: "SIMPLE_RADIAL".
        width, height: image size [px].
        parameters: in COLMAP's order.

    Raises:
        LensError: a model that we do not have, or parameters that no lens has.
    """
    if model not in _FORMS:
        raise LensError(f"the lens model {model} is not known; known are {', '.join(sorted(_FORMS))}")
    distortion_model, focal_lengths, coefficients = _FORMS[model]
    focal, rest = parameters[:focal_lengths], parameters[focal_lengths:]
    (cx, cy), distortion = rest[:2], rest[2:]
    k = (focal[0], 0.0, cx - PIXEL_SHIFT, 0.0, focal[-1], cy - PIXEL_SHIFT, 0.0, 0.0, 1.0)
    d = [*distortion, *[0.0] * (coefficients - len(distortion))]
    return camera_from_info(name, width, height, distortion_model, d, k)


_before = signal.getsignal(signal.SIGTERM)


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
