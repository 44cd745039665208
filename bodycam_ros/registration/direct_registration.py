"""Direct registration of one camera: landmarks are found in its images by the photographs of the map.

A patch of a photograph, warped to the camera's predicted view, is aligned with every image anew, to a third of a pixel,
where descriptors give half a pixel and tracks keep that error. It needs a pose nearby: that of the image before,
predicted (A eq. 2), and corrected by some landmarks of that image on coarse levels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import local_scales, radial_gains
from bodycam_ros.geometry import Array
from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.map_photographs import MapPhotographs, pyramid_levels, pyramid_size, write_pyramid
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_numbers
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.search_kernels import choose_views, correct_prediction, find_landmarks
from bodycam_ros.settings import setting
from bodycam_ros.tracking.camera_motion import ImageMotion

_ENOUGH, _ENOUGH_SHARE = 24, 0.25  # landmarks, and of those looked for: at ten images a second 26 of 113 were 16 cm off
_NO_MOTION = np.zeros(0)


@dataclass(frozen=True)
class DirectSettings:
    """Whether and how densely landmarks are found by photographs."""

    enabled: bool = setting(
        True, reason="find landmarks with the photographs of the map; false uses tracks and descriptors instead"
    )
    per_cell: int = setting(
        2,
        limits=(1, 20),
        reason="landmarks in each of the 64 cells of an image; raise it for better poses, at the same cost in time",
    )


@dataclass(frozen=True)
class DirectView:
    """Landmarks found in an image, and the pose fitted to them.

    Attributes:
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4) the pose.
        rows: (N,) of the landmarks in the map, those that agree with the pose.
        pixels: (N, 2) their places in the image.
        information: (6, 6) of the pose; None where it was not fitted to these pixels.
        shifts: (N, 2) how far the read-out of the rows moved them [px].
        share: of the landmarks that were looked for; few are found from a pose nearby that is wrong.
    """

    stamp_ns: int
    world_T_camera: Array
    rows: NDArray[np.int64]
    pixels: Array
    information: Array | None = None
    shifts: Array | None = None
    share: float = 1.0

    @property
    def is_enough(self) -> bool:
        """Whether landmarks do alone; else tracks and descriptors are used as well."""
        return len(self.rows) >= _ENOUGH and self.share >= _ENOUGH_SHARE


class DirectRegistration:
    """Finds a camera's landmarks in its images, one after the other.

    Args:
        camera: its model.
        reference_map: with photographs.
        photographs: of the map.
        settings, pose_fit: of the stage and of its fits.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        photographs: MapPhotographs,
        settings: DirectSettings,
        pose_fit: PoseFitSettings,
    ) -> None:
        self._photographs, self._per_cell = photographs, settings.per_cell
        self._lens = camera.parameters
        self._scales = local_scales(camera)
        self._gains = radial_gains(camera)
        self._levels = pyramid_levels(camera.height, camera.width)
        self._image, self._image_before = np.zeros((2, pyramid_size(self._levels)), np.uint8)
        # How often each landmark was found, fading: -0.5 never, 0.5 always, 0 unknown.
        self._trust = np.zeros(len(reference_map.landmark_ids), np.float32)
        self._points, self._normals = as_rows(reference_map.points_world), as_rows(photographs.normals)
        self._surfaces, self._world_T_reference = reference_map.surfaces, as_rows(photographs.world_T_camera)
        self._fit = fit_numbers(pose_fit)

    def add_image(self, image: NDArray[np.uint8]) -> None:
        """The next image (H, W)."""
        self._image, self._image_before = self._image_before, self._image
        write_pyramid(image, self._levels, self._image)

    def register(
        self, before: DirectView, predicted: Array, motion: ImageMotion | None, stamp_ns: int
    ) -> DirectView | None:
        """The landmarks in the latest image, from the view before it; None if too few are found.

        Args:
            before: of the image before.
            predicted: (4, 4) predicted pose.
            motion: of the camera while its rows are read out; None if all are exposed together.
            stamp_ns: of the latest image [ns].
        """
        pose, agree = correct_prediction(
            self._lens,
            as_rows(predicted),
            *_as_kernels_take(motion, predicted),
            self._image,
            self._image_before,
            self._levels,
            before.world_T_camera,
            before.rows,
            before.pixels,
            self._points,
            self._normals,
            self._fit,
        )
        return self.find(pose, motion, stamp_ns) if agree else None

    def find(self, near: Array, motion: ImageMotion | None, stamp_ns: int) -> DirectView | None:
        """The landmarks in the latest image around a pose (4, 4); None if too few are found.

        Args:
            near: (4, 4) the pose, good to 8 pixels.
            motion: as of ``register``.
            stamp_ns: of the latest image [ns].
        """
        photographs, near = self._photographs, as_rows(near)
        moving = _as_kernels_take(motion, near)
        rows, views = choose_views(
            self._lens,
            self._gains,
            self._scales,
            near,
            *moving,
            self._surfaces,
            self._trust,
            self._per_cell,
            self._points,
            photographs.local_scales,
            photographs.camera_of_view,
            self._world_T_reference,
            photographs.first_observation,
            photographs.observation_view,
        )
        photographs.develop(views)
        found, world_T_camera, information, rows, pixels, shifts, share = find_landmarks(
            self._lens,
            near,
            *moving,
            self._image,
            self._levels,
            photographs.lenses,
            photographs.camera_of_view,
            self._world_T_reference,
            photographs.pyramids,
            photographs.levels,
            rows,
            views,
            self._points,
            self._normals,
            self._trust,
            self._fit,
        )
        if not found:
            return None
        return DirectView(stamp_ns, world_T_camera, rows, pixels, information, shifts, share)


def _as_kernels_take(motion: ImageMotion | None, pose: Array) -> tuple[Array, Array]:
    """Motion (20,) and pose (4, 4) of the image before; an empty one and any pose where rows are exposed together."""
    if motion is None or not motion.is_rolling:
        return _NO_MOTION, as_rows(pose)
    return motion.as_vector, as_rows(motion.world_T_previous)
