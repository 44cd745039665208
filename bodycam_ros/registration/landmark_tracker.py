"""Tracks of a camera's images: landmarks found by the map's photographs, features by flow where those are too few.

While enough landmarks are found directly, they are the tracks, with the pose fitted to them. Otherwise features are
followed and described as if there were no photographs; their registration is where direct registration starts again.
"""

from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class TrackedCamera:
    """What the tracker of a camera knows between two images.

    Attributes:
        readout: read-out time of the rows.
        latest: tracks of the latest image; None before the first.
        view: landmarks of the latest image, which the next one is searched from; None while features are followed
            and the registrar has not located the camera.
        track_ids: (N,) tracks of the view's landmarks.
        motion: of the images with a view.
        located_ns: stamp of the image in which the registrar located the camera last [ns].
    """

    readout: Readout = UNKNOWN_READOUT
    latest: TrackFrame | None = None
    view: DirectView | None = None
    track_ids: NDArray[np.uint32] | None = None
    motion: CameraMotion = CameraMotion()
    located_ns: int = 0


class LandmarkTracker:
    """Tracks one camera's images, in order of time.

    Args:
        features: the tracker of features, of the same camera.
        reference_map: the map; None, or one without photographs: features alone are tracked.
        settings, pose_fit: of the direct registration and its fits.
        turn: the rotations between images by the camera's gyroscope; None without one.
    """

    def __init__(
        self,
        features: FeatureTracker,
        reference_map: ReferenceMap | None,
        settings: DirectSettings,
        pose_fit: PoseFitSettings,
        turn: CameraTurn | None = None,
    ) -> None:
        self._features = features
        self._map = reference_map
        self._pose_fit = pose_fit
        self._turn = turn
        self._direct: DirectRegistration | None = None
        if settings.enabled and reference_map is not None and reference_map.photographs is not None:
            self._direct = DirectRegistration(
                features.camera, reference_map, reference_map.photographs, settings, pose_fit
            )
        # Filled and emptied within a step: row in the map -> track, 0 for none.
        self._track_of_row = np.zeros(0 if reference_map is None else len(reference_map.landmark_ids), np.uint32)

    def track(self, known: TrackedCamera, image: NDArray[np.uint8], stamp_ns: int) -> tuple[TrackedCamera, TrackFrame]:
        """Track the next image.

        Args:
            known: after the image before.
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.

        Returns:
            What is known after it, and its tracks.

        Raises:
            RecordingError: as ``FeatureTracker.track``.
        """
        if self._direct is None:
            frame = self._track_features(image, stamp_ns, self._measured_turn(known, stamp_ns))
            return replace(known, latest=frame), frame
        self._features.check(image, stamp_ns)
        self._direct.add_image(image)
        current_R_previous = self._measured_turn(known, stamp_ns)
        view = self._find_landmarks(self._direct, known, stamp_ns, current_R_previous)
        if view is not None and view.is_enough and not self._features.keyframe_wanted:
            frame, track_ids = self._frame_of_landmarks(known, view)
            self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous, afresh=True)
            motion = known.motion.with_pose(stamp_ns, view.world_T_camera, frame.previous_stamp_ns)
            return TrackedCamera(known.readout, frame, view, track_ids, motion, known.located_ns), frame
        frame = self._track_features(image, stamp_ns, current_R_previous)
        if view is not None:
            frame = self._merge(known, frame, view)
            self._features.adopt(image, stamp_ns, frame.track_ids, frame.pixels, frame.current_R_previous)
        return replace(known, latest=frame, view=None), frame

    def add_registration(self, known: TrackedCamera, matches: LandmarkMatches) -> TrackedCamera:
        """What is known with the registration of the latest image or, live, of one before it."""
        pose = matches.world_T_camera
        if self._turn is not None and pose is not None:
            self._turn.observe(matches.stamp_ns, pose[:3, :3])
        if pose is None:
            self._features.mark_lost()
        elif known.view is None:
            self._features.prune(matches.stamp_ns, matches.track_ids)
        else:
            self._features.mark_registered()
        if self._direct is None:
            return known
        if matches.readout is not None and matches.readout is not known.readout:
            known = replace(known, readout=matches.readout)
        if pose is None:
            if known.view is not None and matches.stamp_ns > known.located_ns:
                # These landmarks were rejected, and descriptors are needed, which only features have.
                self._features.want_keyframe()
                return replace(known, view=None)
        elif known.view is None:
            return self._locate(known, matches, pose)
        return known

    def want_keyframe(self) -> None:
        """Make the next image a keyframe, for a registrar that starts anew."""
        self._features.want_keyframe()

    def _measured_turn(self, known: TrackedCamera, stamp_ns: int) -> Array | None:
        """(3, 3) rotation current_R_previous since the latest image, by the gyroscope."""
        if self._turn is None or known.latest is None:
            return None
        return self._turn.between(known.latest.stamp_ns, stamp_ns)

    def _track_features(self, image: NDArray[np.uint8], stamp_ns: int, current_R_previous: Array | None) -> TrackFrame:
        """Tracks of features alone; the gyroscope's rotation takes the place of that of the tracks."""
        frame = self._features.track(image, stamp_ns, current_R_previous)
        if current_R_previous is None:
            return frame
        return replace(frame, current_R_previous=current_R_previous, rotation_inliers=max(1, frame.rotation_inliers))

    def _find_landmarks(
        self, direct: DirectRegistration, known: TrackedCamera, stamp_ns: int, current_R_previous: Array | None
    ) -> DirectView | None:
        """Landmarks in the latest image, around its pose predicted with the gyroscope's turn, else without it."""
        before = known.view
        if before is None:
            return None
        readout_time = known.readout.in_use
        angular_velocity = self._turn.angular_velocity(stamp_ns) if self._turn is not None and readout_time else None
        motion = known.motion.in_image(stamp_ns, before.stamp_ns, None, readout_time, angular_velocity)
        for turn in (None,) if current_R_previous is None else (current_R_previous, None):
            predicted = known.motion.predict(stamp_ns - before.stamp_ns, turn)
            if predicted is None:
                return None
            view = direct.register(before, predicted, motion, stamp_ns)
            if view is not None:
                return view
        return None

    def _frame_of_landmarks(self, known: TrackedCamera, view: DirectView) -> tuple[TrackFrame, NDArray[np.uint32]]:
        """Tracks of a view alone, and the ids of its landmarks; one that was tracked before keeps its track."""
        ids = self._track_ids(known, view.rows)
        order = np.argsort(ids)
        rows, before = view.rows[order], known.view
        assert before is not None and self._map is not None and view.shifts is not None
        frame = TrackFrame(
            camera=self._features.camera.name,
            stamp_ns=view.stamp_ns,
            previous_stamp_ns=before.stamp_ns,
            track_ids=ids[order],
            pixels=view.pixels[order].astype(np.float32),
            current_R_previous=view.world_T_camera[:3, :3].T @ before.world_T_camera[:3, :3],
            rotation_inliers=len(ids),
            landmark_ids=self._map.landmark_ids[rows],
            landmark_rows=rows,
            world_T_camera=view.world_T_camera,
            pose_information=view.information,
            shifts=view.shifts[order],
        )
        return frame, ids

    def _merge(self, known: TrackedCamera, frame: TrackFrame, view: DirectView) -> TrackFrame:
        """Features of a frame and landmarks of a view; those that are both have the view's pixels."""
        assert self._map is not None
        ids = self._track_ids(known, view.rows)
        landmarks = self._map.landmark_ids[view.rows]
        pixels, landmark_ids = frame.pixels.copy(), np.full(len(frame.track_ids), NO_LANDMARK, np.uint32)
        rows, both = find_rows(frame.track_ids, ids)
        pixels[rows[both]], landmark_ids[rows[both]] = view.pixels[both], landmarks[both]
        # Tracks that flow has lost get new ids, larger than all others.
        more = np.flatnonzero(~both)
        return replace(
            frame,
            track_ids=np.concatenate([frame.track_ids, self._features.new_ids(len(more))]),
            pixels=np.concatenate([pixels, view.pixels[more].astype(np.float32)]),
            landmark_ids=np.concatenate([landmark_ids, landmarks[more]]),
        )

    def _track_ids(self, known: TrackedCamera, rows: NDArray[np.int64]) -> NDArray[np.uint32]:
        """(N,) the tracks of landmarks; one that had none in the view before gets a new id."""
        before, track_of_row = known.view, self._track_of_row
        assert before is not None and known.track_ids is not None
        track_of_row[before.rows] = known.track_ids
        ids = track_of_row[rows]
        track_of_row[before.rows] = 0
        fresh = np.flatnonzero(ids == 0)
        ids[fresh] = self._features.new_ids(len(fresh))
        return ids

    def _locate(self, known: TrackedCamera, matches: LandmarkMatches, near: Array) -> TrackedCamera:
        """With the pose of the latest image, by those of its tracks that the registrar has matched."""
        latest, reference_map = known.latest, self._map
        if latest is None or reference_map is None:
            return known
        _, rows, of_matches = np.intersect1d(
            latest.track_ids, matches.track_ids, assume_unique=True, return_indices=True
        )
        landmarks, there = reference_map.rows_of(matches.landmark_ids[of_matches])
        rows, landmarks = rows[there], landmarks[there]
        if len(landmarks) < _LEAST_MATCHED:
            return known
        points_world, pixels = reference_map.points_world[landmarks], latest.pixels[rows].astype(np.float64)
        motion = known.motion.in_image(
            latest.stamp_ns, latest.previous_stamp_ns, latest.measured_rotation, known.readout.in_use
        )
        fit = fit_pose(self._features.camera, points_world, pixels, near, self._pose_fit, motion)
        agree = fit.inliers
        if agree.sum() < _LEAST_MATCHED:
            return known
        return replace(
            known,
            view=DirectView(latest.stamp_ns, fit.world_T_camera, landmarks[agree], pixels[agree]),
            track_ids=latest.track_ids[rows[agree]],
            motion=known.motion.with_pose(latest.stamp_ns, fit.world_T_camera, latest.previous_stamp_ns),
            located_ns=latest.stamp_ns,
        )
