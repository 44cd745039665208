"""What a camera should have seen: the wearer's limbs and the map's landmarks, where a body puts them in its image."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.plots.stick_figure import Bone
from bodycam_ros.registration.landmark_matches import LandmarkMatches

GOOD, GOOD_PX = "#35e0c4", 3.0
"""Landmarks this near to their tracks are drawn as good; on grey images a light colour shows."""

_POINTS_PER_BONE = 40  # a straight line is bent in a fisheye image


@dataclass(frozen=True, eq=False)
class Overlay:
    """What is drawn over one image.

    Attributes:
        limbs: (segment, (K, 2) pixels of a bone); NaN outside the lens.
        equipment: (K, 2) pixels of each line of what stands beside the body; NaN outside the lens.
        pixels: (N, 2) where the named tracks are [px], as the image shows them.
        projected: (N, 2) where their landmarks fall when their rows are exposed [px]; NaN outside the lens.
    """

    limbs: tuple[tuple[str, Array], ...]
    equipment: tuple[Array, ...]
    pixels: Array
    projected: Array

    @classmethod
    def of(
        cls, model: CameraModel, world_T_camera: Array, limbs: Iterable[Bone], matches: LandmarkMatches | None
    ) -> "Overlay":
        """What belongs over an image.

        Args:
            model: the camera's lens.
            world_T_camera: (4, 4) where the body puts it [m].
            limbs: lines of the body and its equipment at this one instant [m].
            matches: landmarks that were found in the image.
        """
        camera_T_world = inverse(world_T_camera)
        along = np.linspace(0.0, 1.0, _POINTS_PER_BONE)[:, None]
        lines, equipment = [], []
        for limb in limbs:
            points_world = (1.0 - along) * limb.start + along * limb.end
            line = model.project(transform_points(camera_T_world, points_world))[0]
            if limb.is_equipment:
                equipment.append(line)
            else:
                lines.append((limb.segment, line))
        if matches is None or not len(matches.pixels):
            return cls(tuple(lines), tuple(equipment), np.zeros((0, 2)), np.zeros((0, 2)))
        points_world = matches.points_world.astype(np.float64)
        projected, _ = model.project(transform_points(camera_T_world, points_world))
        # The pose is that of the middle row; what other rows show was moved by their read-out.
        shown = matches.shown.astype(np.float64)
        return cls(tuple(lines), tuple(equipment), shown, projected + (shown - matches.pixels))

    @property
    def errors(self) -> Array:
        """(N,) distances between tracks and landmarks [px]."""
        distances: Array = np.linalg.norm(self.projected - self.pixels, axis=1)
        return distances
