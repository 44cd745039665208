"""Pose of a static camera by its own images and a reference map (A 4.1, for a camera that does not move).

Each image is registered by itself first, so that a camera that moves is noticed. From the pose that they agree
on, landmarks are looked for in all images by the photographs of the map, and one pose is fitted to those that several
images show.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import StaticCameraError
from bodycam_ros.geometry import Array, inverse, log_se3, robust_average_pose, transform_points
from bodycam_ros.registration.direct_registration import DirectRegistration, DirectSettings
from bodycam_ros.registration.image_registration import ImageRegistration
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import MAX_SIGMA_M, RegistrarSettings
from bodycam_ros.settings import SettingsGroups
from bodycam_ros.static_cameras.static_camera import StaticCamera

_KEYPOINTS = 2000  # of an image; 600 give two thirds of the landmarks, in as good as the same time
_PER_CELL = 20  # landmarks in each cell of an image; in the hall 2 leave 1.3 to 4.8 mm, 20 leave 0.4 to 2.6
_AGREE_SIGMAS = 6.0  # of one image's pose from that of all; images of a static camera, half covered, stay within 5.2
_STILL_PX = 1.0  # shift of the picture whatever the sigmas: a tripod gives way where people jump
_LEAST_IMAGES = 2  # fewer do not show whether the camera moves, nor what in an image does
_FEW = 0.5  # of the usual landmarks; an image with fewer is dark, or a person stands before it
_SURE = 60
"""Landmarks by which an image is registered right, however many others show: those that were wrong by more than 50 mm,
of 81 with half to three quarters of the picture covered, had 22, 32 and 56."""

_ROUNDS = 2
"""The first finds landmarks around a pose by descriptors, some pixels off, the second around its own."""

_DEGENERATE = 1e10  # condition of a pose's information: its landmarks leave a direction open
_SHOW_MORE = (
    "photograph what it sees and build the map again, or turn it to what the map covers (coverage.png in it shows that)"
)


@dataclass(frozen=True)
class StaticCamerasSettings(SettingsGroups):
    """Settings of every step from the images of a static camera to its pose."""

    registrar: RegistrarSettings = RegistrarSettings()
    pose_fit: PoseFitSettings = PoseFitSettings()
    direct: DirectSettings = DirectSettings()


@dataclass(frozen=True, eq=False)
class RegisteredStaticCamera:
    """A static camera whose place was found.

    Attributes:
        station: the camera in the map.
        images: how many gave landmarks.
        asked: of how many.
        landmarks: that the pose was fitted to.
        error_px: root mean square of their reprojection errors.
        covariance: (6, 6) of the pose, rotation [rad] then translation [m], both in camera axes.
    """

    station: StaticCamera
    images: int
    asked: int
    landmarks: int
    error_px: float
    covariance: Array

    @property
    def sigma_deg(self) -> float:
        """Standard deviation of the rotation, all axes together [deg]."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[:3, :3]))))

    @property
    def sigma_mm(self) -> float:
        """Standard deviation of the position, all axes together [mm]."""
        return float(1e3 * np.sqrt(np.trace(self.covariance[3:, 3:])))


@dataclass(frozen=True, eq=False)
class _View:
    """What one image shows: landmarks by their rows (N,) in the map, at pixels (N, 2), and the pose by them alone."""

    rows: NDArray[np.int64]
    pixels: Array
    fit: PoseFit

    def apart(self, world_T_camera: Array) -> Array:
        """(6,) from a pose to that of the image, rotation [rad] then translation [m]."""
        return log_se3(inverse(world_T_camera) @ self.fit.world_T_camera)


class StaticCameraRegistration:
    """Finds one static camera.

    Args:
        camera: its model.
        reference_map: the map.
        settings: of all steps.
    """

    def __init__(
        self, camera: CameraModel, reference_map: ReferenceMap, settings: StaticCamerasSettings | None = None
    ) -> None:
        self._camera, self._map = camera, reference_map
        self._settings = settings or StaticCamerasSettings()

    def register(self, images: Sequence[NDArray[np.uint8]]) -> RegisteredStaticCamera:
        """Find where the camera stands.

        Args:
            images: (height, width) grey, of different times.

        Raises:
            StaticCameraError: too few of the images show enough of the map, or the camera moves; the message has what
                to do.
        """
        if len(images) < _LEAST_IMAGES:
            raise self._error(f"{len(images)} of its images can be used, expected {_LEAST_IMAGES} or more")
        alone = self._register_each(images)
        if len(alone) < _LEAST_IMAGES:
            raise self._error(f"{len(alone)} of its {len(images)} images can be registered in the map; {_SHOW_MORE}")
        average = robust_average_pose(np.array([view.fit.world_T_camera for view in alone.values()]))
        agreed = [view for view in alone.values() if self._is_at(view, average)]
        if len(agreed) < _LEAST_IMAGES:
            raise self._moves(alone.values(), average)
        fit, used = self._fit_common(agreed, average), len(agreed)
        found, by_photographs = self._find_by_photographs(images, fit)
        if by_photographs.inliers.sum() > fit.inliers.sum():
            fit, used = by_photographs, len(found)
        # An image that shows little of the place may be registered wrong by metres. So landmarks that were looked for
        # from the pose count first, and its own registration only if it shows few of them.
        telling = _informative(alone, _SURE) | _informative(found)
        if elsewhere := [view for view in telling.values() if not self._is_at(view, fit.world_T_camera)]:
            raise self._moves(elsewhere, fit.world_T_camera)
        return self._registered(fit, used, len(images))

    def _register_each(self, images: Sequence[NDArray[np.uint8]]) -> dict[int, _View]:
        """Number -> view of the images that can be registered, each without regard to the others."""
        settings, views = self._settings, {}
        registration = ImageRegistration(self._camera, self._map, settings.registrar, settings.pose_fit, _KEYPOINTS)
        for number, image in enumerate(images):
            matches = registration.register(image)
            if matches.world_T_camera is not None:
                rows, _ = self._map.rows_of(matches.landmark_ids)
                pixels = matches.pixels.astype(np.float64)
                views[number] = _View(rows, pixels, self._fit(rows, pixels, matches.world_T_camera))
        return views

    def _find_by_photographs(
        self, images: Sequence[NDArray[np.uint8]], start: PoseFit
    ) -> tuple[dict[int, _View], PoseFit]:
        """What all images show of the photographs of the map from a pose, and the pose by that.

        Nothing, and the pose as it was, if the map has no photographs, or too few images show something of them.
        """
        settings = self._settings
        photographs = self._map.photographs
        fit = start
        views = dict[int, _View]()
        if photographs is None or not settings.direct.enabled:
            return views, start
        asked = replace(settings.direct, per_cell=_PER_CELL)
        direct = DirectRegistration(self._camera, self._map, photographs, asked, settings.pose_fit)
        for _ in range(_ROUNDS):
            views = {}
            for number, image in enumerate(images):
                direct.add_image(image)
                if (found := direct.find(fit.world_T_camera, None, 0)) is not None:
                    alone = self._fit(found.rows, found.pixels, found.world_T_camera)
                    views[number] = _View(found.rows, found.pixels, alone)
            if len(views) < _LEAST_IMAGES:
                return {}, start
            fit = self._fit_common(views.values(), fit.world_T_camera)
        return views, fit

    def _fit_common(self, views: Collection[_View], near: Array) -> PoseFit:
        """One pose by the landmarks that several views have, where their medians have them (A eq. 8, first term).

        A landmark counts once: what is wrong with it, or with its photograph, is wrong in all images alike.
        """
        rows = np.concatenate([view.rows for view in views])
        order = np.argsort(rows, kind="stable")
        pixels = np.concatenate([view.pixels for view in views])[order]
        named, first, count = np.unique(rows[order], return_index=True, return_counts=True)
        several = np.flatnonzero(count >= _LEAST_IMAGES)
        medians = [np.median(pixels[first[at] : first[at] + count[at]], axis=0) for at in several]
        return self._fit(named[several], np.array(medians, np.float64).reshape(-1, 2), near)

    def _fit(self, rows: NDArray[np.int64], pixels: Array, near: Array) -> PoseFit:
        return fit_pose(self._camera, self._map.points_world[rows], pixels, near, self._settings.pose_fit)

    def _is_at(self, view: _View, world_T_camera: Array) -> bool:
        """Whether an image may have been taken from a pose (4, 4), or from so near that it hardly matters."""
        xi = view.apart(world_T_camera)
        if xi @ view.fit.information @ xi <= _AGREE_SIGMAS**2:
            return True
        points_world = self._map.points_world[view.rows[view.fit.inliers]]
        here, there = (
            self._camera.project(transform_points(inverse(pose), points_world))[0]
            for pose in (view.fit.world_T_camera, world_T_camera)
        )
        # A landmark that is out of view from there is NaN, and so is the median.
        return bool(np.median(np.linalg.norm(there - here, axis=1)) <= _STILL_PX)

    def _registered(self, fit: PoseFit, images: int, asked: int) -> RegisteredStaticCamera:
        landmarks, covariance = int(fit.inliers.sum()), np.full((6, 6), np.inf)
        if landmarks >= self._settings.registrar.min_inliers and np.linalg.cond(fit.information) < _DEGENERATE:
            covariance = np.asarray(np.linalg.inv(fit.information), np.float64)
        if not np.trace(covariance[3:, 3:]) < MAX_SIGMA_M**2:
            raise self._error(f"its images have {landmarks} landmarks of the map in common, too few; {_SHOW_MORE}")
        station = StaticCamera(self._camera.name, fit.world_T_camera, self._camera)
        error_px = float(np.sqrt(np.mean(fit.errors_px[fit.inliers] ** 2)))
        return RegisteredStaticCamera(station, images, asked, landmarks, error_px, covariance)

    def _moves(self, views: Collection[_View], world_T_camera: Array) -> StaticCameraError:
        apart = np.array([view.apart(world_T_camera) for view in views])
        turn, shift = (np.linalg.norm(part, axis=1).max() for part in np.split(apart, 2, axis=1))
        return self._error(
            f"it moves, by {1e3 * shift:.0f} mm and {np.degrees(turn):.1f} deg at least; fasten it, record again, or "
            "leave it out (--cameras) if it is on the body"
        )

    def _error(self, problem: str) -> StaticCameraError:
        return StaticCameraError(f"camera {self._camera.name}: {problem}")


def _informative(views: dict[int, _View], sure: float = np.inf) -> dict[int, _View]:
    """The views that show about as many landmarks as the others, or as many as are sure to be right."""
    counts = {number: int(view.fit.inliers.sum()) for number, view in views.items()}
    usual = float(np.median([*counts.values()])) if counts else 0.0
    return {number: view for number, view in views.items() if counts[number] >= min(sure, _FEW * usual)}
