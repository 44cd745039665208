"""Tracks of a camera's images: landmarks found by the map's photographs, features by flow where those are too few.

While enough landmarks are found directly, they are the tracks, with the pose fitted to them. Otherwise features are
followed and described as if there were no photographs; their registration is where direct registration starts again.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import UNKNOWN_READOUT, Readout
from bodycam_ros.geometry import Array
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.registration.direct_registration import DirectRegistration, DirectSettings, DirectView
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.camera_motion import CameraMotion
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame, find_rows

_LEAST_MATCHED = 8  # tracks with a landmark from which direct registration starts


class LandmarkTracker:
    """Tracks one camera's images, in order of time.

    Args:
        features: the tracker of features, of the same camera.
        reference_map: the map; None, or one without photographs: features alone are tracked.
        settings, pose_fit: of the direct registration and its fits.
        readout: read-out time of the rows, as far as it is known before the first image.
        turn: the rotations between images by the camera's gyroscope; None without one.
    """

    def __init__(
        self,
        features: FeatureTracker,
        reference_map: ReferenceMap | None,
        settings: DirectSettings,
        pose_fit: PoseFitSettings,
        readout: Readout | None = None,
        turn: CameraTurn | None = None,
    ) -> None:
        self._features, self._map, self._pose_fit = features, reference_map, pose_fit
        self._turn = turn
        self._direct: DirectRegistration | None = None
        if settings.enabled and reference_map is not None and reference_map.photographs is not None:
            self._direct = DirectRegistration(
                features.camera, reference_map, reference_map.photographs, settings, pose_fit
            )
        self._readout = readout or UNKNOWN_READOUT
        self._motion = CameraMotion()
        self._before: DirectView | None = None
        self._located_ns = 0
        rows = 0 if reference_map is None else len(reference_map.landmark_ids)
        self._track_of_row = np.zeros(rows, np.uint32)  # of the map; 0 for a landmark that is not tracked
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
            frame = self._latest = self._track_features(image, stamp_ns, self._measured_turn(stamp_ns))
            return frame
        self._features.check(image, stamp_ns)
        self._direct.add_image(image)
        current_R_previous = self._measured_turn(stamp_ns)
        view = self._find_landmarks(self._direct, stamp_ns, current_R_previous)
        if view is not None and view.is_enough and not self._features.keyframe_wanted:
            frame = self._frame_of_landmarks(view)
            self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous, afresh=True)
            self._motion.add(stamp_ns, view.world_T_camera, frame.previous_stamp_ns)
            self._before = view
        else:
            frame = self._track_features(image, stamp_ns, current_R_previous)
            if view is not None:
                frame = self._merge(frame, view)
                self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous)
            self._before = None  # until the registrar has located the camera
        self._latest = frame
        return frame

    def add_registration(self, matches: LandmarkMatches) -> None:
        """The registration of the latest frame or, live, of one before it."""
        if self._turn is not None and matches.world_T_camera is not None:
            self._turn.observe(matches.stamp_ns, matches.world_T_camera[:3, :3])
        is_registered = matches.world_T_camera is not None
        if not is_registered:
            self._features.mark_lost()
        elif self._before is None:
            self._features.prune(matches.stamp_ns, matches.track_ids)
        else:
            self._features.mark_registered()
        if self._direct is None:
            return
        self._readout = matches.readout or self._readout
        if matches.world_T_camera is None:
            if self._before is not None and matches.stamp_ns > self._located_ns:
                # These landmarks were rejected, and descriptors are needed, which only features have.
                self._before = None
                self._features.want_keyframe()
        elif self._before is None:
            self._locate(matches, matches.world_T_camera)

    def want_keyframe(self) -> None:
        """Make the next image a keyframe, for a registrar that starts anew."""
        self._features.want_keyframe()

    def _measured_turn(self, stamp_ns: int) -> Array | None:
        """(3, 3) rotation current_R_previous since the latest image, by the gyroscope."""
        if self._turn is None or self._latest is None:
            return None
        return self._turn.between(self._latest.stamp_ns, stamp_ns)

    def _track_features(self, image: NDArray[np.uint8], stamp_ns: int, current_R_previous: Array | None) -> TrackFrame:
        """Tracks of features alone; the gyroscope's rotation takes the place of that of the tracks."""
        frame = self._features.track(image, stamp_ns, current_R_previous)
        if current_R_previous is None:
            return frame
        return replace(frame, current_R_previous=current_R_previous, rotation_inliers=max(1, frame.rotation_inliers))

    def _find_landmarks(
        self, direct: DirectRegistration, stamp_ns: int, current_R_previous: Array | None
    ) -> DirectView | None:
        """Landmarks in the latest image, around its pose predicted with the gyroscope's turn, else without it."""
        before = self._before
        if before is None:
            return None
        readout_time = self._readout.in_use
        angular_velocity = self._turn.angular_velocity(stamp_ns) if self._turn is not None and readout_time else None
        motion = self._motion.in_image(stamp_ns, before.stamp_ns, None, readout_time, angular_velocity)
        for turn in (None,) if current_R_previous is None else (current_R_previous, None):
            predicted = self._motion.predict(stamp_ns - before.stamp_ns, turn)
            if predicted is None:
                return None
            view = direct.register(before, predicted, motion, stamp_ns)
            if view is not None:
                return view
        return None

    def _frame_of_landmarks(self, view: DirectView) -> TrackFrame:
        """Tracks of a view alone; a landmark that was tracked in the image before keeps its track."""
        ids = self._track_ids(view.rows)
        order = np.argsort(ids)
        before = self._before
        assert before is not None and self._map is not None and view.shifts is not None
        return TrackFrame(
            camera=self._features.camera.name,
            stamp_ns=view.stamp_ns,
            previous_stamp_ns=before.stamp_ns,
            track_ids=ids[order],
            pixels=view.pixels[order].astype(np.float32),
            current_R_previous=view.world_T_camera[:3, :3].T @ before.world_T_camera[:3, :3],
            rotation_inliers=len(ids),
            landmark_ids=self._map.landmark_ids[view.rows[order]],
            world_T_camera=view.world_T_camera,
            pose_information=view.information,
            shifts=view.shifts[order],
        )

    def _merge(self, frame: TrackFrame, view: DirectView) -> TrackFrame:
        """Features of a frame and landmarks of a view; those that are both have the view's pixels."""
        assert self._map is not None
        ids = self._track_ids(view.rows)
        landmarks = self._map.landmark_ids[view.rows]
        pixels, landmark_ids = frame.pixels.copy(), np.full(len(frame.track_ids), NO_LANDMARK, np.uint32)
        rows, both = find_rows(frame.track_ids, ids)
        pixels[rows[both]], landmark_ids[rows[both]] = view.pixels[both], landmarks[both]
        more = np.flatnonzero(~both)
        # Tracks that flow has lost get new ids, larger than all others.
        fresh = self._features.new_ids(len(more))
        self._track_of_row[view.rows[more]] = fresh
        return replace(
            frame,
            track_ids=np.concatenate([frame.track_ids, fresh]),
            pixels=np.concatenate([pixels, view.pixels[more].astype(np.float32)]),
            landmark_ids=np.concatenate([landmark_ids, landmarks[more]]),
        )

    def _track_ids(self, rows: NDArray[np.int64]) -> NDArray[np.uint32]:
        """(N,) the tracks of landmarks; one that had none in the frame before gets a new id."""
        ids = self._track_of_row[rows]
        ids[ids == 0] = self._features.new_ids(int(np.count_nonzero(ids == 0)))
        self._set_tracks(rows, ids)
        return ids

    def _set_tracks(self, rows: NDArray[np.int64], ids: NDArray[np.uint32]) -> None:
        """The tracks of landmarks (N,), the only ones that are tracked."""
        self._track_of_row[:] = 0
        self._track_of_row[rows] = ids

    def _locate(self, matches: LandmarkMatches, near: Array) -> None:
        """Pose of the latest image, by those of its tracks that the registrar has matched."""
        latest, reference_map = self._latest, self._map
        if latest is None or reference_map is None:
            return
        _, rows, of_matches = np.intersect1d(
            latest.track_ids, matches.track_ids, assume_unique=True, return_indices=True
        )
        landmarks, known = reference_map.rows_of(matches.landmark_ids[of_matches])
        rows, landmarks = rows[known], landmarks[known]
        if len(landmarks) < _LEAST_MATCHED:
            return
        points_world, pixels = reference_map.points_world[landmarks], latest.pixels[rows].astype(np.float64)
        motion = self._motion.in_image(
            latest.stamp_ns, latest.previous_stamp_ns, latest.measured_rotation, self._readout.in_use
        )
        fit = fit_pose(self._features.camera, points_world, pixels, near, self._pose_fit, motion)
        agree = fit.inliers
        if agree.sum() < _LEAST_MATCHED:
            return
        self._located_ns = latest.stamp_ns
        self._before = DirectView(latest.stamp_ns, fit.world_T_camera, landmarks[agree], pixels[agree])
        self._set_tracks(landmarks[agree], latest.track_ids[rows[agree]])
        self._motion.add(latest.stamp_ns, fit.world_T_camera, latest.previous_stamp_ns)
