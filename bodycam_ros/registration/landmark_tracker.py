"""What is tracked in a camera's images: landmarks by the map's photographs, features by flow where those are too few.

While enough landmarks are found directly, they are the tracks, each with its landmark's name. Else features are
followed and described as if there were no photographs, and what the registrar makes of them tells where to look
directly again.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout, readout_of
from bodycam_ros.registration.direct_registration import DirectRegistration, DirectSettings, DirectView
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose
from bodycam_ros.registration.readout_time import ReadoutTime, ShutterSettings
from bodycam_ros.registration.recent_path import RecentPath, RegisteredView
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame, camera_velocity, predict_pose

_LEAST_NAMED = 8


class LandmarkTracker:
    """Tracks one camera's images, in order of time.

    Args:
        features: the tracker of features, of the same camera.
        reference_map: the map; None, or one without photographs, leaves it to the features.
        settings, pose_fit, shutter: of the direct registration, its fits, and of rows read out one by one.
        readout: how long the rows are read out, as far as it is known before the first image.
    """

    def __init__(
        self,
        features: FeatureTracker,
        reference_map: ReferenceMap | None,
        settings: DirectSettings,
        pose_fit: PoseFitSettings,
        shutter: ShutterSettings,
        readout: Readout | None = None,
    ) -> None:
        self._features = features
        self._settings, self._pose_fit, self._shutter = settings, pose_fit, shutter
        self._map = reference_map
        self._direct: DirectRegistration | None = None
        if settings.enabled and reference_map is not None and reference_map.photographs is not None:
            self._direct = DirectRegistration(
                features.camera, reference_map, reference_map.photographs, settings, pose_fit
            )
        self._readout = ReadoutTime(shutter, readout)
        self._path = RecentPath(shutter)
        self._before: DirectView | None = None
        self._earlier: DirectView | None = None
        self._located_ns = 0
        self._track_of_landmark: dict[int, int] = {}
        self._latest: TrackFrame | None = None

    def track(self, image: NDArray[np.uint8], stamp_ns: int) -> TrackFrame:
        """Track the next image.

        Args:
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.

        Raises:
            RecordingError: as ``FeatureTracker.track``.
        """
        if self._direct is None:
            return self._features.track(image, stamp_ns)
        self._features.check(image, stamp_ns)
        self._direct.see(image)
        view = self._look(self._direct, stamp_ns)
        if view is not None and len(view.rows) >= self._settings.enough and not self._features.keyframe_wanted:
            frame = self._frame_of(view)
            self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous, afresh=True)
            self._go_on(view)
        else:
            frame = self._features.track(image, stamp_ns)
            if view is not None:
                frame = self._joined(frame, view)
                self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous)
            # Where the camera is, the registrar says.
            self._earlier, self._before = self._before, None
        self._latest = frame
        return frame

    def hear(self, matches: LandmarkMatches) -> None:
        """What the registrar made of a frame: of the latest, or, live, of one before it."""
        if matches.world_T_camera is not None:
            self._features.prune(matches.stamp_ns, matches.track_ids)
        else:
            self._features.lost()
        if self._direct is None:
            return
        if (known := readout_of(matches.readout_time, matches.readout_sigma)) is not None:
            self._readout = ReadoutTime(self._shutter, known)
        if matches.world_T_camera is None:
            if self._before is not None and matches.stamp_ns > self._located_ns:
                # Who does not believe these landmarks needs descriptors, which only features have.
                self._before = None
                self._features.want_keyframe()
        elif self._before is None:
            self._locate(matches, matches.world_T_camera)

    def want_keyframe(self) -> None:
        """Make the next image a keyframe, for a registrar that knows nothing of the tracks so far."""
        self._features.want_keyframe()

    def _look(self, direct: DirectRegistration, stamp_ns: int) -> DirectView | None:
        """Landmarks in the image just seen, from where the camera should be if it kept moving."""
        before = self._before
        if before is None:
            return None
        predicted = before.world_T_camera
        if self._earlier is not None:
            passed_ns = before.stamp_ns - self._earlier.stamp_ns
            velocity = camera_velocity(self._earlier.world_T_camera, before.world_T_camera, passed_ns)
            predicted = predict_pose(predicted, velocity, stamp_ns - before.stamp_ns)
        motion = self._path.motion(stamp_ns, before.stamp_ns, None, self._readout)
        return direct.register(before, predicted, motion, stamp_ns)

    def _frame_of(self, view: DirectView) -> TrackFrame:
        """Tracks of a view alone; a landmark that was tracked in the image before keeps its track."""
        ids = self._ids_of(view.rows)
        order = np.argsort(ids)
        before = self._before
        assert before is not None and self._map is not None
        return TrackFrame(
            camera=self._features.camera.name,
            stamp_ns=view.stamp_ns,
            previous_stamp_ns=before.stamp_ns,
            track_ids=ids[order],
            pixels=view.pixels[order].astype(np.float32),
            described=np.zeros(0, np.uint32),
            descriptors=np.zeros((0, DESCRIPTOR_LENGTH), np.uint8),
            scales=np.zeros(0, np.float32),
            keyframe=False,
            current_R_previous=view.world_T_camera[:3, :3].T @ before.world_T_camera[:3, :3],
            rotation_inliers=len(ids),
            landmark_ids=self._map.landmark_ids[view.rows[order]],
        )

    def _joined(self, frame: TrackFrame, view: DirectView) -> TrackFrame:
        """Features of a frame, and landmarks of a view: those that are both lie where the view has them."""
        assert self._map is not None
        ids = self._ids_of(view.rows)
        names = self._map.landmark_ids[view.rows]
        pixels, landmark_ids = frame.pixels.copy(), np.full(len(frame.track_ids), NO_LANDMARK, np.uint32)
        at = np.searchsorted(frame.track_ids, ids)
        both = at < len(frame.track_ids)
        both[both] = frame.track_ids[at[both]] == ids[both]
        pixels[at[both]], landmark_ids[at[both]] = view.pixels[both], names[both]
        more = np.flatnonzero(~both)
        # Tracks that flow has lost begin anew, behind all others.
        fresh = self._features.new_ids(len(more))
        self._track_of_landmark |= dict(zip(view.rows[more].tolist(), fresh.tolist(), strict=True))
        return replace(
            frame,
            track_ids=np.concatenate([frame.track_ids, fresh]),
            pixels=np.concatenate([pixels, view.pixels[more].astype(np.float32)]),
            landmark_ids=np.concatenate([landmark_ids, names[more]]),
        )

    def _ids_of(self, rows: NDArray[np.int64]) -> NDArray[np.uint32]:
        """(N,) the tracks of landmarks; who had none in the frame before gets one."""
        known = self._track_of_landmark
        without = [row for row in rows.tolist() if row not in known]
        known |= dict(zip(without, self._features.new_ids(len(without)).tolist(), strict=True))
        self._track_of_landmark = {row: known[row] for row in rows.tolist()}
        return np.array(list(self._track_of_landmark.values()), np.uint32)

    def _go_on(self, view: DirectView) -> None:
        assert self._map is not None and self._before is not None
        points_world = self._map.points_world[view.rows]
        registered = RegisteredView(view.stamp_ns, view.world_T_camera, points_world, view.pixels)
        self._path.add(registered, self._before.stamp_ns)
        self._earlier, self._before = self._before, view

    def _locate(self, matches: LandmarkMatches, near: NDArray[np.float64]) -> None:
        """Where the camera is in the latest image, by tracks of it that the registrar has named."""
        latest, reference_map = self._latest, self._map
        if latest is None or reference_map is None:
            return
        _, at, of = np.intersect1d(latest.track_ids, matches.track_ids, assume_unique=True, return_indices=True)
        rows, known = reference_map.rows_of(matches.landmark_ids[of])
        at, rows = at[known], rows[known]
        if len(rows) < _LEAST_NAMED:
            return
        points_world, pixels = reference_map.points_world[rows], latest.pixels[at].astype(np.float64)
        motion = self._path.motion(latest.stamp_ns, latest.previous_stamp_ns, latest, self._readout)
        fit = fit_pose(self._features.camera, points_world, pixels, near, self._pose_fit, motion)
        if fit.inliers.sum() < _LEAST_NAMED:
            return
        agree = fit.inliers
        self._located_ns = latest.stamp_ns
        self._before = DirectView(latest.stamp_ns, fit.world_T_camera, rows[agree], pixels[agree])
        self._track_of_landmark = dict(zip(rows[agree].tolist(), latest.track_ids[at[agree]].tolist(), strict=True))
        registered = RegisteredView(latest.stamp_ns, fit.world_T_camera, points_world[agree], pixels[agree])
        self._path.add(registered, latest.previous_stamp_ns)
