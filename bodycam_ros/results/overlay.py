"""Limbs and landmarks projected into an image by the pose of a solved body."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bodycam_ros.body.stick_figure import Bone
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.registration.landmark_matches import LandmarkMatches

GOOD, GOOD_PX = "#35e0c4", 3.0
"""Colour of landmarks within this distance [px] of their tracks; on grey images a light colour shows."""

_POINTS_PER_BONE = 40  # a straight line is bent in a fisheye image


@dataclass(frozen=True, eq=False)
class Overlay:
    """What is drawn over one image.

    Attributes:
        limbs: (segment, (K, 2) pixels of a bone); NaN outside the lens.
        equipment: (K, 2) pixels of each line of equipment; NaN outside the lens.
        pixels: (N, 2) named tracks [px], as the image shows them.
        projected: (N, 2) their landmarks at the exposure of their rows [px]; NaN outside the lens.
    """

    limbs: tuple[tuple[str, Array], ...]
    equipment: tuple[Array, ...]
    pixels: Array
    projected: Array

    @property
    def errors(self) -> Array:
        """(N,) distances between tracks and landmarks [px]."""
        distances: Array = np.linalg.norm(self.projected - self.pixels, axis=1)
        return distances


def project_overlay(
    model: CameraModel, world_T_camera: Array, bones: Iterable[Bone], matches: LandmarkMatches | None
) -> Overlay:
    """Project limbs, equipment and landmarks into an image.

    Args:
        model: the camera's lens.
        world_T_camera: (4, 4) its solved pose [m].
        bones: lines of the body and its equipment at this one time [m].
        matches: landmarks that were found in the image.
    """
    camera_T_world = inverse(world_T_camera)
    along = np.linspace(0.0, 1.0, _POINTS_PER_BONE)[:, None]
    limbs, equipment = [], []
    for bone in bones:
        points_world = (1.0 - along) * bone.start + along * bone.end
        line = model.project(transform_points(camera_T_world, points_world))[0]
        if bone.is_equipment:
            equipment.append(line)
        else:
            limbs.append((bone.segment, line))
    shown, projected = np.zeros((0, 2)), np.zeros((0, 2))
    if matches is not None and len(matches.pixels):
        shown = matches.shown.astype(np.float64)
        points_world = matches.points_world.astype(np.float64)
        # The pose is that of the middle row; other rows were moved by their read-out.
        projected = model.project(transform_points(camera_T_world, points_world))[0] + (shown - matches.pixels)
    return Overlay(tuple(limbs), tuple(equipment), shown, projected)
