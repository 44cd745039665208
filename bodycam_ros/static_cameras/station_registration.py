"""Pose of a static camera by its own images and a reference map (A 4.1, for a camera that does not move).

Each image is registered by itself first, so that a camera that moves is noticed. From the pose that they agree
on, landmarks are looked for in all images by the photographs of the map, and one pose is fitted to those that several
images show.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import StationError
from bodycam_ros.geometry import Array, inverse, log_se3, robust_average_pose, transform_points
from bodycam_ros.registration.direct_registration import DirectRegistration, DirectSettings
from bodycam_ros.registration.image_registration import ImageRegistration
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import MAX_SIGMA_M, RegistrarSettings
from bodycam_ros.settings import SettingsGroups
from bodycam_ros.static_cameras.station import Station

_KEYPOINTS = 2000  # of an image; 600 give two thirds of the landmarks, in as good as the same time
_PER_CELL = 20  # landmarks in each cell of an image; in the hall 2 leave 1.3 to 4.8 mm, 20 leave 0.4 to 2.6
_AGREE_SIGMAS = 6.0  # of one image's pose from that of all; images of a static camera, half covered, stay within 5.2
_STILL_PX = 1.0  # shift of the picture whatever the sigmas: a tripod gives way where people jump

LEAST_IMAGES = 2
"""Fewer do not show whether the camera moves, nor what in an image does."""

_FEW = 0.5
"""An image that shows less than this share of the usual landmarks is dark, or a person stands before it."""

_SURE = 60
"""Landmarks by which an image is registered right, however many others show: those that were wrong by more than 50 mm,
of 81 with half to three quarters of the picture covered, had 22, 32 and 56."""


@dataclass(frozen=True)
class StationsSettings(SettingsGroups):
    """Settings of every step from the images of a static camera to its pose."""

    registrar: RegistrarSettings = RegistrarSettings()
    pose_fit: PoseFitSettings = PoseFitSettings()
    direct: DirectSettings = DirectSettings()


@dataclass(frozen=True, eq=False)
class View:
    """What one image shows.

    Attributes:
        camera: that took it.
        rows: (N,) of landmarks in the map.
        points_world: (N, 3) where the map has them [m].
        pixels: (N, 2) where the image has them.
        fit: the pose by them alone.
    """

    camera: CameraModel
    rows: NDArray[np.int64]
    points_world: Array
    pixels: Array
    fit: PoseFit

    @property
    def count(self) -> int:
        """Landmarks that agree."""
        return int(self.fit.inliers.sum())

    def apart(self, world_T_camera: Array) -> Array:
        """(6,) from a pose to that of the image, rotation [rad] then translation [m]."""
        return log_se3(inverse(world_T_camera) @ self.fit.world_T_camera)

    def is_at(self, world_T_camera: Array) -> bool:
        """Whether the image may have been taken from a pose (4, 4), or from so near that it hardly matters."""
        xi = self.apart(world_T_camera)
        if xi @ self.fit.information @ xi <= _AGREE_SIGMAS**2:
            return True
        points_world = self.points_world[self.fit.inliers]
        here, there = (
            self.camera.project(transform_points(inverse(pose), points_world))[0]
            for pose in (self.fit.world_T_camera, world_T_camera)
        )
        # A landmark that is out of view from there is NaN, and so is the median.
        return bool(np.median(np.linalg.norm(there - here, axis=1)) <= _STILL_PX)


Views = Mapping[int, View]
"""Number of an image -> what it shows."""


def common_landmarks(views: Views) -> tuple[NDArray[np.int64], Array]:
    """Rows (N,) of the landmarks that several views have, and where their medians have them (N, 2).

    A landmark counts once: what is wrong with it, or with the photograph that shows it, is wrong in all images alike.
    """
    rows = np.concatenate([view.rows for view in views.values()])
    pixels = np.concatenate([view.pixels for view in views.values()])
    order = np.argsort(rows, kind="stable")
    named, first, count = np.unique(rows[order], return_index=True, return_counts=True)
    several = np.flatnonzero(count >= LEAST_IMAGES)
    medians = [np.median(pixels[order[first[at] : first[at] + count[at]]], axis=0) for at in several]
    return named[several], np.array(medians, np.float64).reshape(-1, 2)


def informative(views: Views, sure: float = np.inf) -> dict[int, View]:
    """The views that show about as many landmarks as the others, or as many as are sure to be right."""
    usual = np.median([view.count for view in views.values()]) if views else 0.0
    return {number: view for number, view in views.items() if view.count >= min(sure, _FEW * usual)}


_ROUNDS = 2
"""The first finds landmarks around a pose by descriptors, some pixels off, the second around its own."""

_DEGENERATE = 1e10  # condition of a pose's information: its landmarks leave a direction open

_SHOW_MORE = (
    "photograph what it sees and build the map again, or turn it to what the map covers (coverage.png in it shows that)"
)


@dataclass(frozen=True, eq=False)
class RegisteredStation:
    """A static camera whose place was found.

    Attributes:
        station: the camera in the map.
        images: how many gave landmarks.
        asked: of how many.
        landmarks: that the pose was fitted to.
        error_px: root mean square of their reprojection errors.
        covariance: (6, 6) of the pose, rotation [rad] then translation [m], both in camera axes.
    """

    station: Station
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


class StationRegistration:
    """Finds one static camera.

    Args:
        camera: its model.
        reference_map: the map.
        settings: of all steps.
    """

    def __init__(
        self, camera: CameraModel, reference_map: ReferenceMap, settings: StationsSettings | None = None
    ) -> None:
        self._camera, self._map = camera, reference_map
        self._settings = settings or StationsSettings()

    def register(self, images: Sequence[NDArray[np.uint8]]) -> RegisteredStation:
        """Find where the camera stands.

        Args:
            images: (height, width) grey, of different times.

        Raises:
            StationError: too few of the images show enough of the map, or the camera moves; the message has what to
                do.
        """
        if len(images) < LEAST_IMAGES:
            raise self._error(f"{len(images)} of its images can be used, expected {LEAST_IMAGES} or more")
        alone = self._each_alone(images)
        if len(alone) < LEAST_IMAGES:
            raise self._error(f"{len(alone)} of its {len(images)} images show where it stands; {_SHOW_MORE}")
        average = robust_average_pose(np.array([view.fit.world_T_camera for view in alone.values()]))
        agreed = {number: view for number, view in alone.items() if view.is_at(average)}
        if len(agreed) < LEAST_IMAGES:
            raise self._moves(alone, average)
        fit, used = self._together(agreed, average), len(agreed)
        looked_for, fit_of_those = self._looked_for(images, fit)
        if fit_of_those is not None and fit_of_those.inliers.sum() > fit.inliers.sum():
            fit, used = fit_of_those, len(looked_for)
        self._check_still(alone, looked_for, fit.world_T_camera)
        return self._registered(fit, used, len(images))

    def _each_alone(self, images: Sequence[NDArray[np.uint8]]) -> Views:
        """The images that can be registered, each without regard to the others."""
        settings = self._settings
        registration = ImageRegistration(self._camera, self._map, settings.registrar, settings.pose_fit, _KEYPOINTS)
        views = {}
        for number, image in enumerate(images):
            matches = registration.register(image)
            if matches.world_T_camera is not None:
                rows, _ = self._map.rows_of(matches.landmark_ids)
                views[number] = self._view(rows, matches.pixels.astype(np.float64), matches.world_T_camera)
        return views

    def _looked_for(self, images: Sequence[NDArray[np.uint8]], fit: PoseFit) -> tuple[Views, PoseFit | None]:
        """What all images show of the photographs of the map from a pose, and the pose by that.

        None if the map has no photographs, or too few images show something of them.
        """
        settings, photographs = self._settings, self._map.photographs
        if photographs is None or not settings.direct.enabled:
            return {}, None
        asked = replace(settings.direct, per_cell=_PER_CELL)
        direct = DirectRegistration(self._camera, self._map, photographs, asked, settings.pose_fit)
        for _ in range(_ROUNDS):
            views = {}
            for number, image in enumerate(images):
                direct.add_image(image)
                if (found := direct.find(fit.world_T_camera, None, 0)) is not None:
                    views[number] = self._view(found.rows, found.pixels, found.world_T_camera)
            if len(views) < LEAST_IMAGES:
                return {}, None
            fit = self._together(views, fit.world_T_camera)
        return views, fit

    def _check_still(self, alone: Views, looked_for: Views, world_T_camera: Array) -> None:
        """Refuse a camera whose images show that it was elsewhere than at a pose (4, 4).

        An image that shows little of the place may be registered wrong by metres. So landmarks that were looked for
        from the pose count first, and its own registration only if it shows few of them.
        """
        telling = informative(alone, _SURE) | informative(looked_for)
        elsewhere = {number: view for number, view in telling.items() if not view.is_at(world_T_camera)}
        if elsewhere:
            raise self._moves(elsewhere, world_T_camera)

    def _moves(self, views: Views, world_T_camera: Array) -> StationError:
        apart = np.array([view.apart(world_T_camera) for view in views.values()])
        turn, shift = (np.linalg.norm(part, axis=1).max() for part in np.split(apart, 2, axis=1))
        return self._error(
            f"it moves, by {1e3 * shift:.0f} mm and {np.degrees(turn):.1f} deg at least; fix it and record again, or "
            "leave it out (--cameras) if it is worn"
        )

    def _together(self, views: Views, near: Array) -> PoseFit:
        """One pose by the landmarks that several views have (A eq. 8, first term)."""
        rows, pixels = common_landmarks(views)
        return self._fit(rows, pixels, near)

    def _registered(self, fit: PoseFit, images: int, asked: int) -> RegisteredStation:
        registrar, landmarks = self._settings.registrar, int(fit.inliers.sum())
        covariance = np.full((6, 6), np.inf)
        if landmarks >= registrar.min_inliers and np.linalg.cond(fit.information) < _DEGENERATE:
            covariance = np.asarray(np.linalg.inv(fit.information), np.float64)
        if not np.trace(covariance[3:, 3:]) < MAX_SIGMA_M**2:
            raise self._error(f"its images have {landmarks} landmarks of the map in common, too few; {_SHOW_MORE}")
        return RegisteredStation(
            Station(self._camera.name, fit.world_T_camera, self._camera),
            images,
            asked,
            landmarks,
            float(np.sqrt(np.mean(fit.errors_px[fit.inliers] ** 2))),
            covariance,
        )

    def _view(self, rows: NDArray[np.int64], pixels: Array, near: Array) -> View:
        return View(self._camera, rows, self._map.points_world[rows], pixels, self._fit(rows, pixels, near))

    def _fit(self, rows: NDArray[np.int64], pixels: Array, near: Array) -> PoseFit:
        return fit_pose(self._camera, self._map.points_world[rows], pixels, near, self._settings.pose_fit)

    def _error(self, problem: str) -> StationError:
        return StationError(f"camera {self._camera.name}: {problem}")
