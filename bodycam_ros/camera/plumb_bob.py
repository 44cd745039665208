"""The ordinary lens model of ROS and OpenCV: three radial, two tangential coefficients; COLMAP's OPENCV if k3 = 0."""

from bodycam_ros.camera.model import Array
from bodycam_ros.camera.perspective import PerspectiveCamera


class PlumbBobCamera(PerspectiveCamera):
    """gain = 1 + k1 r^2 + k2 r^4 + k3 r^6."""

    distortion_model = "plumb_bob"
    coefficients = ("k1", "k2", "p1", "p2", "k3")

    def _gain(self, r2: Array) -> Array:
        k1, k2, _, _, k3 = self.distortion
        return 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))

    def _gain_and_slope(self, r2: Array) -> tuple[Array, Array]:
        k1, k2, _, _, k3 = self.distortion
        return 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3))
