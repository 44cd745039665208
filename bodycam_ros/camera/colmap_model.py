"""A camera as COLMAP names and orders it. COLMAP's pixels have the centre of the top left pixel at (0.5, 0.5)."""

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
