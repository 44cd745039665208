"""Camera models: from points in front of a lens to pixels and back."""

from bodycam_ros.camera.camera_info import camera_from_info, camera_from_yaml
from bodycam_ros.camera.model import CameraModel

__all__ = ["CameraModel", "camera_from_info", "camera_from_yaml"]
