"""The landmarks of a camera's tracks, from frame to frame."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame, find_rows

TrackLandmarks = NDArray[np.void]
"""(N,) tracks with a landmark, in order of their rows."""

_TRACK_LANDMARK = np.dtype(
    [
        ("frame_row", "i8"),  # in the latest frame
        ("track_id", "u4"),
        ("landmark", "i8"),  # row in the map
        ("landmark_id", "u4"),  # a row of an extendable map may get another landmark
        ("strikes", "i8"),  # consecutive frames in which it disagreed with the pose
    ]
)

NO_TRACKS: TrackLandmarks = np.zeros(0, _TRACK_LANDMARK)


def tracks_in_frame(tracks: TrackLandmarks, frame: TrackFrame, reference_map: ReferenceMap) -> TrackLandmarks:
    """The tracks that continue in a frame, and those by which the tracker found tracks."""
    new, old = NO_TRACKS, tracks
    if frame.landmark_rows is not None and frame.landmark_ids is not None:
        return _tracks(frame, np.arange(len(frame.track_ids)), frame.landmark_rows, frame.landmark_ids, 0)
    if frame.landmark_ids is not None:
        found = np.flatnonzero(frame.landmark_ids != NO_LANDMARK)
        landmarks, known = reference_map.rows_of(frame.landmark_ids[found])
        new = _tracks(frame, found[known], landmarks[known], frame.landmark_ids[found[known]], 0)
        if len(new) == len(frame.track_ids):
            return new
    rows, alive = find_rows(frame.track_ids, old["track_id"])
    alive &= reference_map.landmark_ids[old["landmark"]] == old["landmark_id"]
    old, rows = old[alive], rows[alive]
    old["frame_row"] = rows
    replaced = np.isin(rows, new["frame_row"]) | np.isin(old["landmark"], new["landmark"])
    return _merged(old[~replaced], new)


def rematched(
    tracks: TrackLandmarks,
    frame: TrackFrame,
    reference_map: ReferenceMap,
    matched: NDArray[np.int64],
    landmarks: NDArray[np.int64],
    strikes: int,
) -> TrackLandmarks:
    """Return the tracks with landmarks (M,) of described tracks, which measure better than older tracks of the same.

    Args:
        tracks: in the frame.
        frame: with the tracks.
        reference_map: the map.
        matched: (M,) rows of the described tracks with a landmark.
        landmarks: (M,) their rows in the map.
        strikes: initial number.
    """
    new = _tracks(frame, matched, landmarks, reference_map.landmark_ids[landmarks], strikes)
    stale = np.isin(tracks["landmark"], landmarks) | np.isin(tracks["frame_row"], frame.described)
    return _merged(tracks[~stale], new)


def _tracks(
    frame: TrackFrame,
    rows: NDArray[np.int64],
    landmarks: NDArray[np.int64],
    landmark_ids: NDArray[np.uint32],
    strikes: int,
) -> TrackLandmarks:
    tracks = np.empty(len(rows), _TRACK_LANDMARK)
    tracks["frame_row"], tracks["track_id"] = rows, frame.track_ids[rows]
    tracks["landmark"], tracks["landmark_id"], tracks["strikes"] = landmarks, landmark_ids, strikes
    return tracks


def _merged(old: TrackLandmarks, new: TrackLandmarks) -> TrackLandmarks:
    both = np.concatenate([old, new])
    return both[np.argsort(both["frame_row"], kind="stable")]
