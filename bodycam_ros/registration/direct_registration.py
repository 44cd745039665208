"""Direct registration of one camera: landmarks are found in its images by the photographs that made the map.

Descriptors name a landmark to half a pixel, and tracks keep that error for as long as they live. A patch of a
photograph, warped to how the camera should see it, is found to a third of a pixel in every image anew, at a fraction of
the cost. What it needs is a pose near by: that of the image before, carried on.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import local_scales
from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.image_pyramid import pyramid_levels, pyramid_size, write_pyramid
from bodycam_ros.registration.landmark_choice_kernels import best_views, choose_landmarks
from bodycam_ros.registration.local_landmarks import LocalLandmarks
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.matching import LandmarkTrust
from bodycam_ros.registration.patch_kernels import align_patches
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.registration.recent_path import ImageMotion
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting

_WHERE_THEY_PROJECT = np.zeros((0, 2))
_ALL_OF_ONE = np.zeros(1, np.uint16)  # camera, that took the image before
_STILL = np.zeros(6)
_AGREE = 0.6  # share of what is found; what agrees by chance is less
_LEAST_FOUND = 8
"""Landmarks of a pose that is worth a look."""


@dataclass(frozen=True)
class DirectSettings:
    """How many landmarks are asked, and when their answers are a registration."""

    enabled: bool = setting(
        True, reason="whether photographs of the map are used; without them tracks and descriptors are"
    )
    cells: int = setting(
        8, limits=(2, 30), reason="columns and rows that the image is divided into, so that landmarks spread over it"
    )
    per_cell: int = setting(2, limits=(1, 20), reason="landmarks that are asked in each")
    coarse: int = setting(
        24, unit="landmarks", limits=(8, 200), reason="of the image before, by which the predicted pose is mended first"
    )
    coarse_level: int = setting(
        3, limits=(1, 4), reason="of the pyramid that they begin on; on 1/8 of the size 4 px are 32"
    )
    fine_level: int = setting(1, limits=(0, 3), reason="of the pyramid that photographs are aligned on first")
    likeness: float = setting(
        0.7, limits=(0.1, 0.99), reason="least correlation of a patch with the image where it was found"
    )
    enough: int = setting(
        24, unit="landmarks", limits=(6, 500), reason="with fewer that agree, tracks and descriptors are asked as well"
    )
    inlier_px: float = setting(
        1.5,
        unit="px",
        limits=(0.2, 10.0),
        reason="a patch that is found farther from its landmark shows something else",
    )
    max_view_angle_deg: float = setting(
        84.0, unit="deg", limits=(20.0, 110.0), reason="patches keep out of the rim of a fisheye picture"
    )
    least_sigma_px: float = setting(
        0.8,
        unit="px",
        limits=(0.0, 20.0),
        reason="of a landmark's feature: a smaller one is blurred away in this image",
    )
    forget: float = setting(
        0.2, limits=(0.01, 1.0), reason="share that the latest image has in how much a landmark is trusted"
    )


@dataclass(frozen=True)
class DirectView:
    """Landmarks that were found in an image.

    Attributes:
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4) the pose that they give.
        rows: (N,) of the landmarks in the map, those that agree with the pose.
        pixels: (N, 2) where the image shows them.
    """

    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    rows: NDArray[np.int64]
    pixels: NDArray[np.float64]


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
        self._camera, self._photographs = camera, photographs
        self._settings = settings
        self._pose_fit = pose_fit
        self._lens, self._scales = camera.parameters, local_scales(camera)
        self._levels = pyramid_levels(camera.height, camera.width)
        # The latest image and the one before it.
        self._pyramids = np.zeros((2, pyramid_size(self._levels)), np.uint8)
        self._trust = LandmarkTrust(len(reference_map.landmark_ids), settings.forget)
        self._local = LocalLandmarks(reference_map.grid, camera.fx, settings.least_sigma_px)
        self._points = as_rows(reference_map.points_world)
        self._sizes = reference_map.landmark_sizes

    def see(self, image: NDArray[np.uint8]) -> None:
        """The next image (H, W)."""
        self._pyramids = self._pyramids[::-1]
        write_pyramid(image, self._levels, self._pyramids[0])

    def register(
        self, before: DirectView, predicted: NDArray[np.float64], motion: ImageMotion | None, stamp_ns: int
    ) -> DirectView | None:
        """The landmarks in the latest image, from the view before it; None if too few are found.

        Args:
            before: of the image before.
            predicted: (4, 4) where the camera should be by now.
            motion: how it moves while its rows are read out; None if all are exposed together.
            stamp_ns: of the latest image [ns].
        """
        pose = self._follow(before, predicted, motion)
        return None if pose is None else self.find(pose, motion, stamp_ns)

    def find(self, near: NDArray[np.float64], motion: ImageMotion | None, stamp_ns: int) -> DirectView | None:
        """The landmarks in the latest image around a pose (4, 4); None if too few are found."""
        rows, _ = choose_landmarks(
            self._lens,
            as_rows(near),
            *self._moving(near, motion),
            self._local.around(near[:3, 3]),
            self._points,
            self._photographs.normals,
            self._sizes,
            self._trust.scaled,
            self._trust.scale,
            self._settings.cells,
            self._settings.per_cell,
            float(self._settings.least_sigma_px),
            float(np.cos(np.radians(self._settings.max_view_angle_deg))),
        )
        views = self._views(rows, near)
        pixels, likeness = self._align(rows, near, motion, views)
        found = np.isfinite(likeness)
        fit = self._fit(rows[found], pixels[found], near, motion)
        agree = np.zeros(len(rows), bool)
        if fit is not None:
            agree[found] = fit.errors_px < self._settings.inlier_px
        if fit is None or agree.sum() < _LEAST_FOUND:
            return None
        self._trust.learn(rows, agree)
        return DirectView(stamp_ns, fit.world_T_camera, rows[agree], pixels[agree])

    def _follow(
        self, before: DirectView, predicted: NDArray[np.float64], motion: ImageMotion | None
    ) -> NDArray[np.float64] | None:
        """The pose by some landmarks of the image before, each looked for as that one showed it (A eq. 2)."""
        few = np.linspace(0, len(before.rows) - 1, min(self._settings.coarse, len(before.rows))).astype(np.int64)
        rows, shown = before.rows[few], before.pixels[few]
        image, previous = self._pyramids
        pixels, likeness = align_patches(
            self._lens,
            as_rows(predicted),
            *self._moving(predicted, motion),
            image,
            self._levels,
            self._lens[None],
            _ALL_OF_ONE,
            as_rows(before.world_T_camera)[None],
            previous[None],
            self._levels[None],
            np.zeros(len(rows), np.int64),
            as_rows(shown),
            self._points[rows],
            as_rows(self._photographs.normals[rows]),
            self._settings.coarse_level,
            1,
            float(self._settings.likeness),
        )
        found = np.isfinite(likeness)
        fit = self._fit(rows[found], pixels[found], predicted, motion)
        if fit is None or fit.inliers.sum() < max(_LEAST_FOUND, _AGREE * found.sum()):
            return None
        return fit.world_T_camera

    def _views(self, rows: NDArray[np.int64], near: NDArray[np.float64]) -> NDArray[np.int64]:
        """(N,) the photograph for each landmark, which is there afterwards."""
        photographs = self._photographs
        views: NDArray[np.int64] = best_views(
            self._scales,
            as_rows(near),
            self._points,
            rows,
            photographs.local_scales,
            photographs.camera_of_view,
            as_rows(photographs.world_T_camera),
            photographs.first_observation,
            photographs.observation_view,
        )
        photographs.develop(views[views >= 0])
        return views

    def _align(
        self,
        rows: NDArray[np.int64],
        near: NDArray[np.float64],
        motion: ImageMotion | None,
        views: NDArray[np.int64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the image shows landmarks (N, 2), by patches of these photographs, and how alike they are (N,)."""
        photographs = self._photographs
        found: tuple[NDArray[np.float64], NDArray[np.float64]] = align_patches(
            self._lens,
            as_rows(near),
            *self._moving(near, motion),
            self._pyramids[0],
            self._levels,
            photographs.lenses,
            photographs.camera_of_view,
            as_rows(photographs.world_T_camera),
            photographs.pyramids,
            photographs.levels,
            views,
            _WHERE_THEY_PROJECT,
            self._points[rows],
            as_rows(photographs.normals[rows]),
            self._settings.fine_level,
            0,
            float(self._settings.likeness),
        )
        return found

    def _fit(
        self,
        rows: NDArray[np.int64],
        pixels: NDArray[np.float64],
        start: NDArray[np.float64],
        motion: ImageMotion | None,
    ) -> PoseFit | None:
        """Pose from landmarks (A eq. 8, first term)."""
        if len(rows) < _LEAST_FOUND:
            return None
        return fit_pose(self._camera, self._points[rows], pixels, start, self._pose_fit, motion)

    def _moving(self, pose: NDArray[np.float64], motion: ImageMotion | None) -> tuple[NDArray[np.float64], float]:
        """Twist and read-out time, as kernels take them."""
        if motion is None or motion.readout_time == 0.0:
            return _STILL, 0.0
        return as_rows(motion.twist_at(pose)), float(motion.readout_time)
