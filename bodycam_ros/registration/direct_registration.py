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
from bodycam_ros.registration.landmark_choice_kernels import best_views, choose_landmarks
from bodycam_ros.registration.map_photographs import MapPhotographs, pyramid_levels, pyramid_size, write_pyramid
from bodycam_ros.registration.patch_kernels import align_patches
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting
from bodycam_ros.tracking.camera_motion import ImageMotion

_COARSE = 20  # landmarks of the image before that correct the predicted pose
_COARSE_LEVELS = 3, 1  # first and last; 4 px of 1/8 of the size are 32
_FINE_LEVELS = 1, 0  # from 0 on, dev_walk is better by 7 %, and compressed and moving images are worse by 15 to 120 %
_LIKENESS = 0.7  # least correlation of a patch with the image
_INLIER_PX = 1.5  # a patch found farther from its landmark shows something else
_AGREE = 0.6  # least share of the coarse landmarks that fit one pose
_LEAST_FOUND = 8  # landmarks of a pose
_ENOUGH, _ENOUGH_SHARE = 24, 0.25  # landmarks, and of those looked for: at ten images a second 26 of 113 were 16 cm off
_FADES = 0.998  # share of a landmark's trust that is left an image later
_LATEST_SHARE = 0.2  # of the latest image in it
_PROJECTIONS = np.zeros((0, 2))
_ONE_CAMERA = np.zeros(1, np.uint16)
_STILL = np.zeros(6)

_References = tuple[Array, NDArray[np.uint16], Array, NDArray[np.uint8], NDArray[np.int64]]
"""Pictures that patches are taken from: lenses of their cameras, the camera and the pose of each, their pyramids, and
the levels of these; as ``align_patches`` takes them."""


@dataclass(frozen=True)
class DirectSettings:
    """Whether and how densely landmarks are found by photographs."""

    enabled: bool = setting(
        True, reason="whether the photographs of the map are used; without them tracks and descriptors are"
    )
    per_cell: int = setting(
        2,
        limits=(1, 20),
        reason="landmarks in each of the 64 cells of an image; more are more exact, and cost as much more time",
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
        self._camera, self._photographs = camera, photographs
        self._per_cell, self._pose_fit = settings.per_cell, pose_fit
        self._lens, self._scales, self._gains = camera.parameters, local_scales(camera), radial_gains(camera)
        self._levels = pyramid_levels(camera.height, camera.width)
        self._pyramids = np.zeros((2, pyramid_size(self._levels)), np.uint8)  # of the latest image and the one before
        # How often each landmark was found, fading: -0.5 never, 0.5 always, 0 unknown.
        self._trust = np.zeros(len(reference_map.landmark_ids), np.float32)
        self._points = as_rows(reference_map.points_world)
        self._surfaces = reference_map.surfaces

    def add_image(self, image: NDArray[np.uint8]) -> None:
        """The next image (H, W)."""
        self._pyramids = self._pyramids[::-1]
        write_pyramid(image, self._levels, self._pyramids[0])

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
        pose = self._correct_prediction(before, predicted, motion)
        return None if pose is None else self.find(pose, motion, stamp_ns)

    def find(self, near: Array, motion: ImageMotion | None, stamp_ns: int) -> DirectView | None:
        """The landmarks in the latest image around a pose (4, 4); None if too few are found.

        Args:
            near: (4, 4) the pose, good to 8 pixels.
            motion: as of ``register``.
            stamp_ns: of the latest image [ns].
        """
        rows, views = self._choose(near, motion)
        photographs = self._photographs
        references = (
            photographs.lenses,
            photographs.camera_of_view,
            as_rows(photographs.world_T_camera),
            photographs.pyramids,
            photographs.levels,
        )
        pixels, found = self._align(near, motion, rows, references, views, _PROJECTIONS, _FINE_LEVELS)
        fit = self._fit(rows[found], pixels[found], near, motion)
        inliers = np.zeros(0, np.int64) if fit is None else np.flatnonzero(fit.errors_px < _INLIER_PX)
        if fit is None or len(inliers) < _LEAST_FOUND:
            return None
        agree = np.zeros(len(rows), bool)
        agree[found[inliers]] = True
        self._trust *= np.float32(_FADES)
        self._trust[rows] += np.float32(_LATEST_SHARE) * (np.where(agree, 0.5, -0.5) - self._trust[rows])
        share = len(inliers) / np.count_nonzero(views >= 0)
        return DirectView(
            stamp_ns, fit.world_T_camera, rows[agree], pixels[agree], fit.information, fit.shifts[inliers], share
        )

    def _choose(self, near: Array, motion: ImageMotion | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The landmarks to look for around a pose, and the photograph for each."""
        photographs = self._photographs
        rows = choose_landmarks(
            self._lens,
            self._gains,
            as_rows(near),
            *_twist_and_time(near, motion),
            self._surfaces,
            self._trust,
            self._per_cell,
        )
        views = best_views(
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
        return rows, views

    def _correct_prediction(self, before: DirectView, predicted: Array, motion: ImageMotion | None) -> Array | None:
        """The pose by some landmarks of the image before, each by its patch in that image (A eq. 2)."""
        count = min(_COARSE, len(before.rows))
        few = np.arange(count) * (len(before.rows) - 1) // max(count - 1, 1)
        rows = before.rows[few]
        seen_from = as_rows(before.world_T_camera)[None]
        references = (self._lens[None], _ONE_CAMERA, seen_from, self._pyramids[1][None], self._levels[None])
        views, shown = np.zeros(len(rows), np.int64), as_rows(before.pixels[few])
        pixels, found = self._align(predicted, motion, rows, references, views, shown, _COARSE_LEVELS)
        fit = self._fit(rows[found], pixels[found], predicted, motion)
        if fit is None or fit.inliers.sum() < max(_LEAST_FOUND, _AGREE * len(found)):
            return None
        return fit.world_T_camera

    def _align(
        self,
        pose: Array,
        motion: ImageMotion | None,
        rows: NDArray[np.int64],
        references: _References,
        views: NDArray[np.int64],
        reference_pixels: Array,
        levels: tuple[int, int],
    ) -> tuple[Array, NDArray[np.int64]]:
        """Pixels (N, 2) of landmarks in the latest image by patches of other pictures, and which were found."""
        twist, readout_time = _twist_and_time(pose, motion)
        pixels, likeness = align_patches(
            self._lens,
            as_rows(pose),
            twist,
            readout_time,
            self._pyramids[0],
            self._levels,
            *references,
            views,
            reference_pixels,
            self._points[rows],
            as_rows(self._photographs.normals[rows]),
            levels[0],
            levels[1],
            _LIKENESS,
        )
        return pixels, np.flatnonzero(np.isfinite(likeness))

    def _fit(self, rows: NDArray[np.int64], pixels: Array, start: Array, motion: ImageMotion | None) -> PoseFit | None:
        """Pose from landmarks (A eq. 8, first term)."""
        if len(rows) < _LEAST_FOUND:
            return None
        return fit_pose(self._camera, self._points[rows], pixels, start, self._pose_fit, motion)


def _twist_and_time(pose: Array, motion: ImageMotion | None) -> tuple[Array, float]:
    """Twist (6,) and read-out time, as kernels take them."""
    if motion is None or motion.readout_time == 0.0:
        return _STILL, 0.0
    return as_rows(motion.twist_of(pose)), float(motion.readout_time)
