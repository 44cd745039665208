"""Where a static camera stands, by its own images and a reference map (A 4.1, for a camera that does not move).

Each image is registered by itself first, so that a camera that moves gives itself away. From the pose that they agree
on, landmarks are looked for in all images by the photographs of the map, and one pose is fitted to those that several
images show. A landmark counts once, however often it was seen: what is wrong with it, or with its photograph, is wrong
in all images alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import StationError
from bodycam_ros.geometry import Array, inverse, log_se3, robust_average_pose
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.station_settings import StationsSettings
from bodycam_ros.registration.direct_registration import DirectRegistration
from bodycam_ros.registration.image_registration import ImageRegistration, ImageRegistrationSettings
from bodycam_ros.registration.pose_fit import PoseFit, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap

_LEAST_IMAGES = 2
"""Fewer cannot tell whether the camera moves, nor what in an image does."""

_FEW = 0.5
"""An image with less than this share of the usual landmarks may be wrong by itself; one with more has moved."""

_ROUNDS = 2
"""The first finds landmarks around a pose by descriptors, some pixels off, the second around its own."""

_SHOW_MORE = (
    "photograph what it sees and build the map again, or turn it to what the map covers ('bodycam map check MAP' says "
    "what that is)"
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


@dataclass(frozen=True, eq=False)
class _View:
    """What one image shows: rows (N,) of landmarks, where (N, 2), and the pose of that alone."""

    rows: NDArray[np.int64]
    pixels: Array
    fit: PoseFit

    @property
    def count(self) -> int:
        return int(self.fit.inliers.sum())


@dataclass(frozen=True, eq=False)
class _Stand:
    """One pose for several images."""

    views: tuple[_View, ...]
    fit: PoseFit

    @property
    def count(self) -> int:
        return int(self.fit.inliers.sum())


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
            StationError: too few of the images show enough of the map, or the camera moves; the message says what to
                do.
        """
        if len(images) < _LEAST_IMAGES:
            raise self._error(f"{len(images)} of its images can be used, expected {_LEAST_IMAGES} or more")
        alone = self._each_alone(images)
        if len(alone) < _LEAST_IMAGES:
            raise self._error(f"{len(alone)} of its {len(images)} images show where it stands; {_SHOW_MORE}")
        near = robust_average_pose(np.array([view.fit.world_T_camera for view in alone]))
        described = self._together(self._still(alone, near), near)
        stand = self._looked_for(images, described.fit.world_T_camera) or described
        if stand.count < max(described.count, self._settings.registrar.min_inliers):
            stand = described  # a map without photographs, or in another light
        return self._registered(stand, len(images))

    def _each_alone(self, images: Sequence[NDArray[np.uint8]]) -> list[_View]:
        """The images that can be registered, each without regard to the others."""
        settings = self._settings
        registration = ImageRegistration(
            self._camera,
            self._map,
            ImageRegistrationSettings(keypoints=settings.stations.keypoints),
            settings.registrar,
            settings.matching,
            settings.absolute_pose,
            settings.pose_fit,
        )
        views = []
        for image in images:
            matches = registration.register(image)
            if matches.world_T_camera is not None:
                rows, _ = self._map.rows_of(matches.landmark_ids)
                views.append(self._view(rows, matches.pixels.astype(np.float64), matches.world_T_camera))
        return views

    def _looked_for(self, images: Sequence[NDArray[np.uint8]], near: Array) -> _Stand | None:
        """All images around a pose, by the photographs of the map; None if it has none or too few show something."""
        settings, photographs = self._settings, self._map.photographs
        if photographs is None or not settings.direct.enabled:
            return None
        asked = replace(settings.direct, per_cell=settings.stations.per_cell)
        direct = DirectRegistration(self._camera, self._map, photographs, asked, settings.pose_fit)
        stand: _Stand | None = None
        for _ in range(_ROUNDS):
            views = []
            for image in images:
                direct.see(image)
                if (found := direct.find(near, None, 0)) is not None:
                    views.append(self._view(found.rows, found.pixels, found.world_T_camera))
            if len(views) < _LEAST_IMAGES:
                return None
            stand = self._together(views, near)
            near = stand.fit.world_T_camera
        assert stand is not None
        return replace(stand, views=tuple(self._still(stand.views, near)))

    def _still(self, views: Sequence[_View], pose: Array) -> list[_View]:
        """The views from one pose; what few landmarks say of another does not count.

        Raises:
            StationError: the others say that the camera moves.
        """
        apart = [log_se3(inverse(pose) @ view.fit.world_T_camera) for view in views]
        sigmas = [float(np.sqrt(xi @ view.fit.information @ xi)) for xi, view in zip(apart, views, strict=True)]
        usual = np.median([view.count for view in views])
        still = [sigma <= self._settings.stations.agree_sigmas for sigma in sigmas]
        moved = [
            xi for xi, view, stays in zip(apart, views, still, strict=True) if not stays and view.count >= _FEW * usual
        ]
        if moved or sum(still) < _LEAST_IMAGES:
            shift, turn = (max(float(np.linalg.norm(xi[part])) for xi in apart) for part in (np.s_[3:], np.s_[:3]))
            raise self._error(
                f"it moves: its images were taken up to {1e3 * shift:.0f} mm and {np.degrees(turn):.1f} deg from where "
                "most were; fix it and record again, or leave it out (--cameras) if it is worn"
            )
        return [view for view, stays in zip(views, still, strict=True) if stays]

    def _together(self, views: Sequence[_View], near: Array) -> _Stand:
        """One pose of the landmarks that several views have, each where their median has it (A eq. 8, first term)."""
        rows = np.concatenate([view.rows for view in views])
        pixels = np.concatenate([view.pixels for view in views])
        order = np.argsort(rows, kind="stable")
        named, first, count = np.unique(rows[order], return_index=True, return_counts=True)
        seen = [np.median(group, axis=0) for group in np.split(pixels[order], first[1:])]
        several = count >= _LEAST_IMAGES
        return _Stand(tuple(views), self._fit(named[several], np.array(seen).reshape(-1, 2)[several], near))

    def _registered(self, stand: _Stand, asked: int) -> RegisteredStation:
        fit, registrar = stand.fit, self._settings.registrar
        covariance = np.full((6, 6), np.inf)
        if stand.count >= registrar.min_inliers:
            covariance = np.asarray(np.linalg.pinv(fit.information, hermitian=True), np.float64)
        if not np.trace(covariance[3:, 3:]) < registrar.max_sigma**2:
            raise self._error(f"its images have {stand.count} landmarks of the map in common, too few; {_SHOW_MORE}")
        return RegisteredStation(
            Station(self._camera.name, fit.world_T_camera, self._camera),
            len(stand.views),
            asked,
            stand.count,
            float(np.sqrt(np.mean(fit.errors_px[fit.inliers] ** 2))),
            covariance,
        )

    def _view(self, rows: NDArray[np.int64], pixels: Array, near: Array) -> _View:
        return _View(rows, pixels, self._fit(rows, pixels, near))

    def _fit(self, rows: NDArray[np.int64], pixels: Array, near: Array) -> PoseFit:
        return fit_pose(self._camera, self._map.points_world[rows], pixels, near, self._settings.pose_fit)

    def _error(self, problem: str) -> StationError:
        return StationError(f"camera {self._camera.name}: {problem}")
