"""A camera as the YAML file that ROS calibration tools write."""

import yaml

from bodycam_ros.camera.model import CameraModel


def camera_info_yaml(camera: CameraModel) -> str:
    """The text of a camera_info YAML, which ``camera_from_yaml`` reads back as the same camera."""
    p = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": camera.name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": list(map(float, camera.k))},
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": {
            "rows": 1,
            "cols": len(camera.distortion),
            "data": list(map(float, camera.distortion)),
        },
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": list(map(float, p))},
    }
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
