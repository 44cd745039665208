"""Absolute registration of one body camera against the reference map (A 4.1).

A frame whose tracks were all found by their landmarks comes with a pose, which is judged. Otherwise described tracks
are matched to the landmarks that should be in view, or to the whole map while the camera is lost, and the pose is
fitted here. A track keeps its landmark until it ends.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import UNKNOWN_READOUT, Readout
from bodycam_ros.geometry import Array
from bodycam_ros.geometry_kernels import invert_positive
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.matching import RADIUS_PX, WIDE_RADIUS_PX, match_near_prediction
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose, steady_pixels
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.track_landmarks import NO_TRACKS, TrackLandmarks, rematched, tracks_in_frame
from bodycam_ros.settings import setting
from bodycam_ros.tracking.camera_motion import CameraMotion, ImageMotion
from bodycam_ros.tracking.track_frame import TrackFrame

MAX_SIGMA_M = 0.1
"""Largest sigma of a pose's position: a dozen landmarks in a corner of the picture let it drift by metres."""

_MAX_STRIKES = 2  # consecutive frames of disagreement after which a track loses its landmark
_MAX_PREDICTED_FRAMES = 15  # of a lost camera, by its rotation, before the whole map is searched
_DEGENERATE = 1e10  # condition of a pose's information: its landmarks leave a direction open, such as all on one spot
_FEW = 0.15  # share of the described tracks; a pose that fewer agree with is compared with one found in the whole map
_EVERY = 3  # images of which one gives the read-out time, for all: neighbours are correlated, and each costs a fit
_LEAST_TURN = 0.5  # [rad/s] images of a camera that turns more slowly carry too little information for a fit
_REFIT_ITERATIONS = 2  # of a fit that starts at the result of another


@dataclass(frozen=True)
class RegistrarSettings:
    """When a camera counts as registered."""

    min_inliers: int = setting(
        12,
        limits=(4, 500),
        reason="minimum number of landmarks that agree with a pose; raise it to reject doubtful poses, but then dim or "
        "crowded places are not registered (the paper takes 50, with twice as many pixels)",
        live=True,
    )


@dataclass(frozen=True)
class _Pose:
    """A pose that was accepted, with its covariance (6, 6), and inliers (N,) and shifts (N, 2) of its tracks."""

    world_T_camera: Array
    covariance: Array
    inliers: NDArray[np.bool_]
    shifts: Array


@dataclass(frozen=True)
class RegisteredCamera:
    """What the registrar of a camera knows between two images.

    Attributes:
        readout: read-out time of the rows.
        tracks: those with a landmark.
        motion: of the registered images.
        unregistered: consecutive images without a pose.
        recent: poses (4, 4), landmarks (N, 3) and pixels (N, 2) of the latest two registered images.
        until_readout: images until the read-out time is measured again.
    """

    readout: Readout = UNKNOWN_READOUT
    tracks: TrackLandmarks = field(default_factory=lambda: NO_TRACKS)
    motion: CameraMotion = CameraMotion()
    unregistered: int = 0
    recent: tuple[tuple[Array, Array, NDArray[np.floating]], ...] = ()
    until_readout: int = 0

    def with_readout(self, readout: Readout) -> "RegisteredCamera":
        """Return the camera with a read-out time from another source, if that is better known."""
        return replace(self, readout=readout) if readout.sigma <= self.readout.sigma else self


class Registrar:
    """Registers the frames of one camera, in order of time.

    Args:
        camera, reference_map: its model; the map, which may be shared by the registrars of all cameras.
        settings, pose_fit: of the registrar and of its fits.

    Attributes:
        settings: may be replaced between two images.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        settings: RegistrarSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
    ) -> None:
        self.camera = camera
        self.map = reference_map
        self.settings = settings or RegistrarSettings()
        self._pose_fit = pose_fit or PoseFitSettings()

    def register(self, known: RegisteredCamera, frame: TrackFrame) -> tuple[RegisteredCamera, LandmarkMatches]:
        """Find the camera's pose and the landmarks of its tracks.

        Args:
            known: after the frame before.
            frame: the next one.

        Returns:
            What is known after it, and its registration.
        """
        tracks = tracks_in_frame(known.tracks, frame, self.map)
        pose = self._accept(frame, tracks)
        predicted = None
        motion = None
        if pose is None:
            rotation, readout_time = frame.measured_rotation, known.readout.in_use
            predicted = known.motion.predict(frame.stamp_ns - frame.previous_stamp_ns, rotation)
            motion = known.motion.in_image(frame.stamp_ns, frame.previous_stamp_ns, rotation, readout_time)
            pose = self._fit(frame, tracks, predicted, motion)
            if len(frame.described):
                tracks, pose = self._match_described(frame, tracks, pose, predicted, motion)
        tracks, shifts = self._reject_outliers(known, frame, tracks, pose, motion)
        if pose is None:
            lost = known.unregistered >= _MAX_PREDICTED_FRAMES
            moved = known.motion.with_unregistered(None if lost else predicted)
            known = replace(known, tracks=tracks, motion=moved, unregistered=known.unregistered + 1)
        else:
            moved = known.motion.with_pose(frame.stamp_ns, pose.world_T_camera, frame.previous_stamp_ns)
            known = replace(known, tracks=tracks, motion=moved, unregistered=0)
            if not known.readout.is_known:
                known = self._with_measured_readout(known, frame, pose)
        return known, self._matches(known.readout, frame, tracks, shifts, pose)

    def _accept(self, frame: TrackFrame, tracks: TrackLandmarks) -> _Pose | None:
        """The tracker's own fit, if it is determined; None if there is none, or the map lacks one of its landmarks."""
        if frame.world_T_camera is None or frame.pose_information is None or frame.shifts is None:
            return None
        if len(tracks) < len(frame.track_ids) or len(tracks) < self.settings.min_inliers:
            return None
        covariance = _covariance(frame.pose_information)
        if covariance is None:
            return None
        return _Pose(frame.world_T_camera, covariance, np.ones(len(tracks), bool), frame.shifts)

    def _fit(
        self, frame: TrackFrame, tracks: TrackLandmarks, start: Array | None, motion: ImageMotion | None
    ) -> _Pose | None:
        """Pose from the tracks with a landmark (A eq. 8, first term), or None if too few of them agree."""
        if start is None or len(tracks) < self.settings.min_inliers:
            return None
        points_world = self.map.points_world[tracks["landmark"]]
        fit = fit_pose(self.camera, points_world, frame.pixels[tracks["frame_row"]], start, self._pose_fit, motion)
        covariance = _covariance(fit.information) if fit.inliers.sum() >= self.settings.min_inliers else None
        return None if covariance is None else _Pose(fit.world_T_camera, covariance, fit.inliers, fit.shifts)

    def _match_described(
        self,
        frame: TrackFrame,
        tracks: TrackLandmarks,
        pose: _Pose | None,
        predicted: Array | None,
        motion: ImageMotion | None,
    ) -> tuple[TrackLandmarks, _Pose | None]:
        """Match the described tracks around the pose there is, fitted or predicted.

        Without one, or where few agree with it, the camera is looked for in the whole map; the pose counts that more
        tracks agree with.
        """
        if pose is None and predicted is not None:
            tracks, pose = self._match_near(frame, tracks, predicted, WIDE_RADIUS_PX, motion)
        near = self._match_again(frame, tracks, pose, motion)
        if near[1] is not None and near[1].inliers.sum() >= _FEW * len(frame.described):
            return near
        # Here, so that the settings can be read without loading pycolmap.
        from bodycam_ros.registration.relocalisation import find_pose

        pixels = self._steady(frame.pixels[frame.described.astype(np.int64)], motion)
        candidate = find_pose(self.camera, self.map, pixels, frame.descriptors)
        if candidate is None:
            return near
        other = self._match_again(frame, *self._match_near(frame, tracks, candidate, WIDE_RADIUS_PX, motion), motion)
        return max(near, other, key=lambda each: 0 if each[1] is None else int(each[1].inliers.sum()))

    def _match_again(
        self, frame: TrackFrame, tracks: TrackLandmarks, pose: _Pose | None, motion: ImageMotion | None
    ) -> tuple[TrackLandmarks, _Pose | None]:
        """Matches closer around a pose, where they give one."""
        if pose is None:
            return tracks, None
        better_tracks, better_pose = self._match_near(frame, tracks, pose.world_T_camera, RADIUS_PX, motion)
        return (better_tracks, better_pose) if better_pose else (tracks, pose)

    def _match_near(
        self,
        frame: TrackFrame,
        tracks: TrackLandmarks,
        near: Array,
        radius_px: float,
        motion: ImageMotion | None,
    ) -> tuple[TrackLandmarks, _Pose | None]:
        """Match the described tracks to landmarks that project near them, and fit the pose to all with a landmark."""
        described = frame.described.astype(np.int64)
        features, landmarks = match_near_prediction(
            self.map,
            self.camera,
            near,
            self._steady(frame.pixels[described], motion),
            frame.descriptors,
            frame.scales,
            radius_px,
        )
        # A new match must agree at once; an old one may fail for a moment.
        matched = rematched(tracks, frame, self.map, described[features], landmarks, _MAX_STRIKES - 1)
        pose = self._fit(frame, matched, near, motion)
        # Matches that no pose confirms are worse than none.
        return (tracks, None) if pose is None else (matched, pose)

    def _steady(self, pixels: NDArray[np.floating], motion: ImageMotion | None) -> Array:
        """Pixels (M, 2) as if all rows were exposed together, near enough for a gate."""
        if motion is None:
            return np.asarray(pixels, np.float64)
        return steady_pixels(self.camera, pixels, motion.turning, motion.readout_time)

    def _with_measured_readout(self, known: RegisteredCamera, frame: TrackFrame, pose: _Pose) -> RegisteredCamera:
        """With the read-out time by the image before the latest; both of its neighbours give its motion."""
        points_world = self.map.points_world[known.tracks["landmark"]]
        latest = pose.world_T_camera, points_world, frame.pixels[known.tracks["frame_row"]]
        known = replace(known, recent=(*known.recent[-1:], latest), until_readout=known.until_readout - 1)
        if known.until_readout > 0 or len(known.recent) < 2:
            return known
        motion = known.motion.in_middle_image(known.readout.seconds, known.readout.sigma)
        if motion is None or np.linalg.norm(motion.turning) < _LEAST_TURN:
            return known
        world_T_camera, points_world, pixels = known.recent[0]
        fit = fit_pose(
            self.camera, points_world, pixels, world_T_camera, self._pose_fit, motion, iterations=_REFIT_ITERATIONS
        )
        readout = known.readout
        if fit.inliers.sum() >= self.settings.min_inliers:
            readout = readout.updated(fit.readout_time, _EVERY * fit.readout_information)
        return replace(known, readout=readout, until_readout=_EVERY)

    def _reject_outliers(
        self,
        known: RegisteredCamera,
        frame: TrackFrame,
        tracks: TrackLandmarks,
        pose: _Pose | None,
        motion: ImageMotion | None,
    ) -> tuple[TrackLandmarks, Array]:
        """Take the landmark from tracks that keep disagreeing; from all once the camera is lost.

        Returns:
            The others, and how far the read-out of the rows moved them in the image (N, 2) [px].
        """
        if pose is None:
            if known.unregistered >= _MAX_PREDICTED_FRAMES:
                tracks = NO_TRACKS
            pixels = frame.pixels[tracks["frame_row"]]
            return tracks, pixels - self._steady(pixels, motion)
        tracks["strikes"] = np.where(pose.inliers, 0, tracks["strikes"] + 1)
        keep = tracks["strikes"] < _MAX_STRIKES
        return tracks[keep], pose.shifts[keep]

    def _matches(
        self, readout: Readout, frame: TrackFrame, tracks: TrackLandmarks, shifts: Array, pose: _Pose | None
    ) -> LandmarkMatches:
        return LandmarkMatches(
            camera=frame.camera,
            stamp_ns=frame.stamp_ns,
            previous_stamp_ns=frame.previous_stamp_ns,
            track_ids=frame.track_ids[tracks["frame_row"]],
            landmark_ids=tracks["landmark_id"].copy(),
            pixels=(frame.pixels[tracks["frame_row"]] - shifts).astype(np.float32),
            points_world=self.map.points_world[tracks["landmark"]].astype(np.float32),
            world_T_camera=None if pose is None else pose.world_T_camera,
            pose_covariance=np.full((6, 6), np.nan) if pose is None else pose.covariance,
            current_R_previous=frame.current_R_previous,
            rotation_inliers=frame.rotation_inliers,
            shifts=shifts.astype(np.float32) if shifts.any() else None,
            readout=readout,
            grown=int((tracks["landmark"] >= self.map.first_grown).sum()),
        )


def _covariance(information: Array) -> Array | None:
    """(6, 6) covariance of a pose, or None if its landmarks do not determine it."""
    covariance, found = invert_positive(information)
    # The product of the traces is at least the condition, and at most 36 times it.
    if not (found and information.trace() * covariance.trace() < _DEGENERATE):
        return None
    return covariance if covariance[3:, 3:].trace() < MAX_SIGMA_M**2 else None
