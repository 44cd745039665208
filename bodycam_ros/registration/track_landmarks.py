"""The landmarks of a camera's tracks, from frame to frame."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame


@dataclass(frozen=True)
class TrackLandmarks:
    """Tracks (N,) with a landmark, ascending.

    Attributes:
        frame_rows: (N,) their rows in the latest frame.
        track_ids: (N,) uint32.
        landmarks: (N,) rows in the map.
        landmark_ids: (N,) uint32; a row of an extendable map may get another landmark.
        strikes: (N,) consecutive frames in which each disagreed with the pose.
    """

    frame_rows: NDArray[np.int64]
    track_ids: NDArray[np.uint32]
    landmarks: NDArray[np.int64]
    landmark_ids: NDArray[np.uint32]
    strikes: NDArray[np.int64]

    @classmethod
    def none(cls) -> Self:
        """Of no track."""
        return cls(*np.zeros((5, 0), np.int64))

    def in_frame(self, frame: TrackFrame, reference_map: ReferenceMap) -> "TrackLandmarks":
        """Those of the tracks that continue in a frame, and those by which the tracker found tracks."""
        if frame.landmark_ids is None:
            return self._continued(frame, reference_map)
        found = np.flatnonzero(frame.landmark_ids != NO_LANDMARK)
        landmarks, known = reference_map.rows_of(frame.landmark_ids[found])
        found, landmarks = found[known], landmarks[known]
        ids = frame.landmark_ids[found]
        new = TrackLandmarks(found, frame.track_ids[found], landmarks, ids, np.zeros(len(found), np.int64))
        if len(found) == len(frame.track_ids):
            return new
        old = self._continued(frame, reference_map)
        return old.kept(~(np.isin(old.frame_rows, found) | np.isin(old.landmarks, landmarks))).merged(new)

    def rematched(
        self,
        frame: TrackFrame,
        reference_map: ReferenceMap,
        matched: NDArray[np.int64],
        landmarks: NDArray[np.int64],
        strikes: int,
    ) -> "TrackLandmarks":
        """With landmarks (M,) of described tracks, which are better measurements than older tracks of the same.

        Args:
            frame: with the tracks.
            reference_map: the map.
            matched: (M,) rows of the described tracks with a landmark.
            landmarks: (M,) their rows in the map.
            strikes: initial number.
        """
        ids, counts = reference_map.landmark_ids[landmarks], np.full(len(landmarks), strikes)
        new = TrackLandmarks(matched, frame.track_ids[matched], landmarks, ids, counts)
        stale = np.isin(self.landmarks, landmarks) | np.isin(self.frame_rows, frame.described)
        return self.kept(~stale).merged(new)

    def judged(self, agree: NDArray[np.bool_]) -> "TrackLandmarks":
        """With one more strike for those (N,) that disagree with the pose, and none for the others."""
        strikes = np.where(agree, 0, self.strikes + 1)
        return TrackLandmarks(self.frame_rows, self.track_ids, self.landmarks, self.landmark_ids, strikes)

    def kept(self, keep: NDArray[np.bool_]) -> "TrackLandmarks":
        """Some of them (N,)."""
        return TrackLandmarks(*(getattr(self, field.name)[keep] for field in fields(self)))

    def merged(self, other: "TrackLandmarks") -> "TrackLandmarks":
        """These and others of the same frame."""
        order = np.argsort(np.concatenate([self.frame_rows, other.frame_rows]), kind="stable")
        return TrackLandmarks(
            *(np.concatenate([getattr(self, f.name), getattr(other, f.name)])[order] for f in fields(self))
        )

    def _continued(self, frame: TrackFrame, reference_map: ReferenceMap) -> "TrackLandmarks":
        rows = np.searchsorted(frame.track_ids, self.track_ids)
        alive = rows < len(frame.track_ids)
        alive[alive] = frame.track_ids[rows[alive]] == self.track_ids[alive]
        alive &= reference_map.landmark_ids[self.landmarks] == self.landmark_ids
        return TrackLandmarks(rows, self.track_ids, self.landmarks, self.landmark_ids, self.strikes).kept(alive)
