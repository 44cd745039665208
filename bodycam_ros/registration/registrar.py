"""Absolute registration of one body camera against the reference map (A 4.1).

A described track is matched to the landmarks that the camera should see, or to the whole map while the camera is lost.
From then on the track carries its landmark until it ends.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.registration.carried_landmarks import CarriedLandmarks
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.local_landmarks import LocalLandmarks
from bodycam_ros.registration.lost_camera import AbsolutePoseSettings, LostCamera
from bodycam_ros.registration.matching import MatchingSettings, match_near_prediction
from bodycam_ros.registration.pose_fit import PoseFit, PoseFitSettings, fit_pose
from bodycam_ros.registration.readout_time import ReadoutTime, ShutterSettings
from bodycam_ros.registration.recent_path import ImageMotion, RecentPath, RegisteredView, steady_pixels
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting
from bodycam_ros.tracking.track_frame import TrackFrame, camera_velocity, predict_pose


@dataclass(frozen=True)
class RegistrarSettings:
    """When a camera counts as registered, and when a track loses its landmark."""

    min_inliers: int = setting(
        12,
        limits=(4, 500),
        reason="fewer landmarks in agreement are no registration (the paper asks 50, with twice as many pixels)",
        live=True,
    )
    max_sigma: float = setting(
        0.1,
        unit="m",
        limits=(0.001, 10.0),
        reason="of a pose's position, by its landmarks: a dozen in a corner of the picture let it drift by metres, and "
        "it takes their successors along",
        live=True,
    )
    max_strikes: int = setting(
        2,
        unit="frames",
        limits=(1, 30),
        reason="a track whose landmark disagrees on this many frames in a row loses it",
        live=True,
    )
    max_predicted_frames: int = setting(
        15,
        unit="frames",
        limits=(0, 300),
        reason="how long a lost camera's pose is carried on by its rotation before the whole map is searched",
        live=True,
    )


_DEGENERATE = 1e10  # condition of a pose's information: its landmarks leave a direction open, such as all on one spot

_FROM_A_FIT = 2  # steps of a fit that starts where another has ended


class Registrar:
    """Registers the frames of one camera, in order of time.

    Args:
        camera, reference_map: its model; the map, which may be shared by the registrars of all cameras.
        settings, matching, absolute_pose, pose_fit, shutter: settings of the registrar and of its steps.
        readout: how long the camera's rows are read out, as far as it is known before the first image.

    Attributes:
        settings: may be replaced between two images.
        readout: the read-out time of the camera's rows.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        settings: RegistrarSettings | None = None,
        matching: MatchingSettings | None = None,
        absolute_pose: AbsolutePoseSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
        shutter: ShutterSettings | None = None,
        readout: Readout | None = None,
    ) -> None:
        self.camera = camera
        self.map = reference_map
        self.settings = settings or RegistrarSettings()
        self._matching = matching or MatchingSettings()
        self._pose_fit = pose_fit or PoseFitSettings()
        self._shutter = shutter or ShutterSettings()
        self.readout = ReadoutTime(self._shutter, readout)
        self._local = LocalLandmarks(reference_map.grid, camera.fx, self._matching.min_visible_scale_px)
        self._lost = LostCamera(camera, reference_map, self._matching, absolute_pose or AbsolutePoseSettings())
        self._path = RecentPath(self._shutter)
        self._carried = CarriedLandmarks(reference_map)
        self._world_T_camera: NDArray[np.float64] | None = None
        self._velocity = np.zeros(6)
        self._frames_predicted = 0
        self._motion: ImageMotion | None = None
        self._until_rows = 0

    def learn(self, readout: Readout) -> None:
        """Somebody knows how long the rows are read out; that counts if it is better than what is known by now."""
        if readout.sigma <= self.readout.sigma and not self.readout.contradicts(readout):
            self.readout = ReadoutTime(self._shutter, readout)

    def register(self, frame: TrackFrame) -> LandmarkMatches:
        """Find the camera's pose and the landmarks that its tracks show."""
        rows = self._carried.into(frame)
        predicted = self._predict(frame)
        self._motion = self._path.motion(frame.stamp_ns, frame.previous_stamp_ns, frame, self.readout)
        fit = self._fit(frame, rows, predicted)
        if len(frame.described):
            rows, fit = self._register_described(frame, rows, fit, predicted)
        rows, shifts = self._strike_out(frame, rows, fit)
        self._remember(frame, fit, predicted)
        if fit is not None:
            points_world = self._carried.points_world
            view = RegisteredView(frame.stamp_ns, fit.world_T_camera, points_world, frame.pixels[rows])
            self._path.add(view, frame.previous_stamp_ns)
            self._time_rows()
        return self._matches(frame, rows, shifts, fit)

    def _register_described(
        self, frame: TrackFrame, rows: NDArray[np.int64], fit: PoseFit | None, predicted: NDArray[np.float64] | None
    ) -> tuple[NDArray[np.int64], PoseFit | None]:
        """Name the described tracks around the best pose there is: fitted, else extrapolated, else searched for."""
        if fit is None and predicted is not None:
            rows, fit = self._name_tracks(frame, rows, predicted, self._matching.lost_radius_px)
        if fit is None:
            rows, fit = self._find(frame, rows)
        if fit is None:
            return rows, None
        named_rows, named_fit = self._name_tracks(frame, rows, fit.world_T_camera, self._matching.radius_px)
        return (named_rows, named_fit) if named_fit else (rows, fit)

    def _predict(self, frame: TrackFrame) -> NDArray[np.float64] | None:
        """The pose that the camera would have if it kept moving; its rotation is measured where possible (A eq. 2)."""
        if self._world_T_camera is None:
            return None
        measured = frame.current_R_previous if frame.rotation_inliers else None
        return predict_pose(self._world_T_camera, self._velocity, frame.stamp_ns - frame.previous_stamp_ns, measured)

    def _fit(self, frame: TrackFrame, rows: NDArray[np.int64], start: NDArray[np.float64] | None) -> PoseFit | None:
        """Pose from the named tracks (A eq. 8, first term), or None if too few of them agree."""
        if start is None or len(rows) < self.settings.min_inliers:
            return None
        fit = fit_pose(self.camera, self._carried.points_world, frame.pixels[rows], start, self._pose_fit, self._motion)
        agree = fit.inliers.sum() >= self.settings.min_inliers
        if not agree or np.linalg.cond(fit.information) >= _DEGENERATE:
            return None
        variance = np.trace(np.linalg.inv(fit.information)[3:, 3:])
        return fit if variance < self.settings.max_sigma**2 else None

    def _name_tracks(
        self, frame: TrackFrame, rows: NDArray[np.int64], pose: NDArray[np.float64], radius_px: float
    ) -> tuple[NDArray[np.int64], PoseFit | None]:
        """Match the described tracks to landmarks that project near them, and fit the pose to all that carry one."""
        described = frame.described.astype(np.int64)
        named, landmarks = match_near_prediction(
            self.map,
            self.camera,
            pose,
            self._steady(frame.pixels[described]),
            frame.descriptors,
            frame.scales,
            radius_px,
            self._matching,
            self._local.around(pose[:3, 3]),
        )
        before = self._carried.snapshot()
        # A fresh match has to prove itself at once; an old one may fail for a moment.
        strikes = self.settings.max_strikes - 1
        all_rows = self._carried.instead_of_older(frame, rows, described, described[named], landmarks, strikes)
        fit = self._fit(frame, all_rows, pose)
        if fit is None:
            # Names that no pose confirms are worse than none.
            self._carried.restore(before)
            return rows, None
        return all_rows, fit

    def _find(self, frame: TrackFrame, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], PoseFit | None]:
        """Name the described tracks around the first pose that they confirm, of those where a lost camera may be."""
        pixels = self._steady(frame.pixels[frame.described.astype(np.int64)])
        for pose in self._lost.poses(pixels, frame.descriptors, frame.scales):
            rows, fit = self._name_tracks(frame, rows, pose, self._matching.lost_radius_px)
            if fit is not None:
                return rows, fit
        return rows, None

    def _steady(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Pixels (M, 2) as they would be if all rows were exposed together, near enough for a gate."""
        turning = np.zeros(3) if self._motion is None else self._motion.turning
        return steady_pixels(self.camera, pixels, turning, self.readout.in_use)

    def _time_rows(self) -> None:
        """Learn the read-out time from the image before, whose motion is known from both sides."""
        self._until_rows -= 1
        if (
            self._until_rows > 0
            or self.readout.is_known
            or (between := self._path.between(self.readout.unchecked)) is None
        ):
            return
        view, motion = between
        if np.linalg.norm(motion.turning) < self._shutter.least_turn:
            return
        self._until_rows = self._shutter.every
        settings = replace(self._pose_fit, iterations=_FROM_A_FIT)
        fit = fit_pose(self.camera, view.points_world, view.pixels, view.world_T_camera, settings, motion)
        if fit.inliers.sum() >= self.settings.min_inliers:
            self.readout.add(fit.readout_time, self._shutter.every * fit.readout_information)

    def _strike_out(
        self, frame: TrackFrame, rows: NDArray[np.int64], fit: PoseFit | None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Take the landmark from tracks that keep disagreeing; from all once the camera is lost.

        Returns:
            The rows that keep theirs, and how far the read-out of the image moved those in the image (N, 2) [px].
        """
        shifts = frame.pixels[rows] - self._steady(frame.pixels[rows]) if fit is None else fit.shifts
        if fit is None:
            keep = self._carried.forget(
                np.full(len(rows), self._frames_predicted >= self.settings.max_predicted_frames)
            )
        else:
            keep = self._carried.judge(fit.inliers, self.settings.max_strikes)
        return rows[keep], shifts[keep]

    def _remember(self, frame: TrackFrame, fit: PoseFit | None, predicted: NDArray[np.float64] | None) -> None:
        if fit is not None:
            self._velocity = np.zeros(6)
            if self._world_T_camera is not None and self._frames_predicted == 0:
                passed_ns = frame.stamp_ns - frame.previous_stamp_ns
                self._velocity = camera_velocity(self._world_T_camera, fit.world_T_camera, passed_ns)
            self._world_T_camera = fit.world_T_camera
            self._frames_predicted = 0
            return
        self._frames_predicted += 1
        self._world_T_camera = predicted if self._frames_predicted <= self.settings.max_predicted_frames else None

    def _matches(
        self, frame: TrackFrame, rows: NDArray[np.int64], shifts: NDArray[np.float64], fit: PoseFit | None
    ) -> LandmarkMatches:
        covariance = np.full((6, 6), np.nan) if fit is None else np.asarray(np.linalg.inv(fit.information), np.float64)
        return LandmarkMatches(
            camera=frame.camera,
            stamp_ns=frame.stamp_ns,
            previous_stamp_ns=frame.previous_stamp_ns,
            track_ids=frame.track_ids[rows],
            landmark_ids=self.map.landmark_ids[self._carried.rows],
            pixels=(frame.pixels[rows] - shifts).astype(np.float32),
            points_world=self._carried.points_world.astype(np.float32),
            world_T_camera=None if fit is None else fit.world_T_camera,
            pose_covariance=covariance,
            current_R_previous=frame.current_R_previous,
            rotation_inliers=frame.rotation_inliers,
            shifts=shifts.astype(np.float32) if shifts.any() else None,
            readout_time=self.readout.seconds,
            readout_sigma=self.readout.sigma,
            grown=int((self._carried.rows >= self.map.first_grown).sum()),
        )
