"""Deviation of a registered camera's lens from its model, by landmarks.

A lens that is not what its model is leaves errors that no pose takes up. Four more unknowns, the focal length,
how it changes towards the rim, and the principal point, are solved for together with each image's pose (A eq. 9); the
poses are eliminated image by image, so that a camera's evidence is a sum of 4x4 systems, whatever the number of images.
"""

from dataclasses import dataclass, field

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, hat
from bodycam_ros.registration.landmark_matches import LandmarkMatches

_UNKNOWNS = 4
_LEAST_LANDMARKS = 12
"""A pose has six unknowns and the lens four; a landmark gives two equations."""

_RADII = np.linspace(0.0, 1.0, 5)
"""Radii, in halves of the image's width, at which the scale is looked at."""


@dataclass(frozen=True)
class LensDeviation:
    """Difference of a lens from its model.

    Attributes:
        scale: share by which the picture is larger, where that is most.
        centre: distance of the principal point from where it should be, as a share of half the image's width.
    """

    scale: float
    centre: float

    @property
    def text(self) -> str:
        """Both in words."""
        way = "out" if self.scale > 0.0 else "in"
        centre = f"its centre is off by {self.centre:.1%} of half the width"
        return f"landmarks lie {abs(self.scale):.1%} farther {way}, {centre}"


@dataclass
class LensEvidence:
    """The sum over one camera's images.

    Attributes:
        camera: its model as the recording has it.
        inlier_px: a landmark farther off than this does not count [px].
        images: that were added.
    """

    camera: CameraModel
    inlier_px: float
    images: int = 0
    _information: Array = field(default_factory=lambda: np.zeros((_UNKNOWNS, _UNKNOWNS)))
    _gradient: Array = field(default_factory=lambda: np.zeros(_UNKNOWNS))

    def add(self, matches: LandmarkMatches) -> None:
        """Add a registered image."""
        pose = matches.world_T_camera
        if pose is None:
            return
        points_camera = (matches.points_world - pose[:3, 3]) @ pose[:3, :3]
        projected, pixel_by_point, valid = self.camera.project_with_jacobian(points_camera)
        errors = np.where(valid, np.linalg.norm(projected - matches.pixels, axis=1), np.inf)
        used = errors < self.inlier_px
        if used.sum() < _LEAST_LANDMARKS:
            return
        by_point = pixel_by_point[used]
        by_pose = np.concatenate([by_point @ hat(points_camera[used]), -by_point], axis=2).reshape(-1, 6)
        by_lens = self._by_lens(projected[used])
        residuals = (projected - matches.pixels)[used].ravel()
        # Schur complement: what the pose can explain is not the lens's.
        explained = np.linalg.lstsq(by_pose, np.column_stack([by_lens, residuals]), rcond=None)[0]
        remaining = by_lens - by_pose @ explained[:, :_UNKNOWNS]
        self._information += remaining.T @ remaining
        self._gradient -= remaining.T @ (residuals - by_pose @ explained[:, _UNKNOWNS])
        self.images += 1

    @property
    def sums(self) -> tuple[int, Array, Array]:
        """Images, information (4, 4) and gradient (4,) so far."""
        return self.images, self._information, self._gradient

    def add_sums(self, images: int, information: Array, gradient: Array) -> None:
        """Add the sums of other images of the same camera."""
        self.images += images
        self._information = self._information + information
        self._gradient = self._gradient + gradient

    def error(self) -> LensDeviation:
        """What explains the errors best."""
        focal, rim, *centre = np.linalg.lstsq(self._information, self._gradient, rcond=None)[0]
        scales = focal + rim * _RADII**2
        return LensDeviation(float(scales[np.argmax(np.abs(scales))]), float(np.linalg.norm(centre)))

    def _by_lens(self, projected: Array) -> Array:
        """Derivatives (2N, 4) of pixels (N, 2) by what the lens may have wrong."""
        half_width = 0.5 * self.camera.width
        from_centre = projected - [self.camera.cx, self.camera.cy]
        squared = (from_centre**2).sum(axis=1, keepdims=True) / half_width**2
        derivatives = np.zeros((len(projected), 2, _UNKNOWNS))
        derivatives[:, :, 0] = from_centre
        derivatives[:, :, 1] = from_centre * squared
        derivatives[:, 0, 2] = derivatives[:, 1, 3] = half_width
        return derivatives.reshape(-1, _UNKNOWNS)
