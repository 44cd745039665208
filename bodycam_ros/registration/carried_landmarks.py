"""Which tracks of a camera carry which landmark, from frame to frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame


@dataclass(frozen=True)
class _Names:
    """Tracks (N,) that carry a landmark, ascending.

    Attributes:
        track_ids: (N,) uint32.
        landmarks: (N,) rows in the map.
        landmark_ids: (N,) uint32, by which a row is known that holds another landmark by now.
        strikes: (N,) frames in a row on which each disagreed.
    """

    track_ids: NDArray[np.uint32]
    landmarks: NDArray[np.int64]
    landmark_ids: NDArray[np.uint32]
    strikes: NDArray[np.int64]

    def kept(self, keep: NDArray[np.bool_]) -> "_Names":
        return _Names(self.track_ids[keep], self.landmarks[keep], self.landmark_ids[keep], self.strikes[keep])


_NOBODY = _Names(np.zeros(0, np.uint32), np.zeros(0, np.int64), np.zeros(0, np.uint32), np.zeros(0, np.int64))


class CarriedLandmarks:
    """The landmarks that the tracks of one camera carry.

    Args:
        reference_map: where they are from; it may grow meanwhile.
    """

    def __init__(self, reference_map: ReferenceMap) -> None:
        self._map = reference_map
        self._names = _NOBODY

    @property
    def rows(self) -> NDArray[np.int64]:
        """(N,) rows of the landmarks in the map."""
        return self._names.landmarks

    @property
    def points_world(self) -> NDArray[np.float64]:
        """(N, 3) where they are [m]."""
        points: NDArray[np.float64] = self._map.points_world[self._names.landmarks]
        return points

    def into(self, frame: TrackFrame) -> NDArray[np.int64]:
        """Rows (N,) of a frame's tracks that carry a landmark; ended tracks take theirs along.

        Tracks that the tracker found by their landmarks are among them.
        """
        names = self._names
        positions = np.searchsorted(frame.track_ids, names.track_ids)
        alive = positions < len(frame.track_ids)
        alive[alive] = frame.track_ids[positions[alive]] == names.track_ids[alive]
        alive &= self._map.landmark_ids[names.landmarks] == names.landmark_ids
        self.forget(~alive)
        rows = np.asarray(positions[alive], np.int64)
        return rows if frame.landmark_ids is None else self._take(frame, frame.landmark_ids, rows)

    def _take(self, frame: TrackFrame, landmark_ids: NDArray[np.uint32], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        named = np.flatnonzero(landmark_ids != NO_LANDMARK)
        landmarks, known = self._map.rows_of(landmark_ids[named])
        named, landmarks = named[known], landmarks[known]
        if len(named) == len(frame.track_ids):
            self._names = _NOBODY
            return self.add(frame, named, landmarks, strikes=0)
        kept = rows[self.forget(np.isin(rows, named) | np.isin(self.rows, landmarks))]
        return self.add(frame, np.concatenate([kept, named]), landmarks, strikes=0)

    def add(
        self, frame: TrackFrame, rows: NDArray[np.int64], landmarks: NDArray[np.int64], strikes: int
    ) -> NDArray[np.int64]:
        """Carry landmarks (M,) beside those that are carried; the rows (N,) of all, theirs last, come back in order."""
        order = np.argsort(rows, kind="stable")
        names, ids = self._names, self._map.landmark_ids[landmarks]
        self._names = _Names(
            frame.track_ids[rows[order]],
            np.concatenate([names.landmarks, landmarks])[order],
            np.concatenate([names.landmark_ids, ids])[order],
            np.concatenate([names.strikes, np.full(len(landmarks), strikes)])[order],
        )
        return rows[order]

    def instead_of_older(
        self,
        frame: TrackFrame,
        rows: NDArray[np.int64],
        fresh: NDArray[np.int64],
        named: NDArray[np.int64],
        landmarks: NDArray[np.int64],
        strikes: int,
    ) -> NDArray[np.int64]:
        """Carry landmarks (M,) of fresh keypoints; where they are those of an older track, that one loses its.

        The fresh one is the better measurement.

        Args:
            frame: with the tracks.
            rows: (N,) of those that carry a landmark.
            fresh: (K,) rows of all keypoints that are fresh.
            named: (M,) rows of those that show the landmarks.
            landmarks: (M,) rows in the map.
            strikes: that they begin with.
        """
        stale = np.isin(self.rows, landmarks) | np.isin(rows, fresh)
        return self.add(frame, np.concatenate([rows[self.forget(stale)], named]), landmarks, strikes)

    def judge(self, agree: NDArray[np.bool_], max_strikes: int) -> NDArray[np.bool_]:
        """Count who disagrees (N,), and forget who did for too long; which of them keep theirs."""
        names = self._names
        strikes = np.where(agree, 0, names.strikes + 1)
        self._names = _Names(names.track_ids, names.landmarks, names.landmark_ids, strikes)
        return self.forget(strikes >= max_strikes)

    def forget(self, forgotten: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Take the landmarks from some of the tracks (N,) that carry one; which of them keep theirs."""
        keep = ~forgotten
        self._names = self._names.kept(keep)
        return keep

    def snapshot(self) -> object:
        """What ``restore`` goes back to."""
        return self._names

    def restore(self, snapshot: object) -> None:
        """Go back to what was carried then."""
        assert isinstance(snapshot, _Names)
        self._names = snapshot
