"""Static cameras as the solver hears them live: each looks at its images in its own process, and says what it saw."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, SegmentPose
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.region_tracker import surface_variances
from bodycam_ros.static_cameras.start_file import placed_expectation, placed_segments
from bodycam_ros.static_cameras.station_watch import followed

_ROUNDS = 3
"""Steps of the body as a whole under what was said, which is linear but for rotations."""


class StationReports:
    """Puts together what stations say of a body, joints closed, as ``RegionTracker`` does that has all their images.

    Args:
        body: segments and joints, held to people's usual limits where it has none; with its equipment, if any.
        placed: (S, 4, 4) where the body is at the first instant, as a person placed it; None where nobody did.
        motion: how suddenly segments change their motion.
    """

    def __init__(self, body: BodyModel, placed: Array | None, motion: MotionSettings) -> None:
        self._body, self._placed = body, placed
        self._motion = motion
        self._step = ArticulatedStep(with_usual_limits(body))
        self._seen: Array | None = None
        self._seen_ns = 0

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``StaticCameras.place``: nothing without a placed body, or before a station speaks.

        After a silence it is placed where it was seen last, and anew only where time begins anew.
        """
        if self._placed is None or not frame.said:
            return []
        poses = self._placed if self._seen is None or frame.stamp_ns <= self._seen_ns else self._seen
        return placed_segments(self._body, poses)

    def measure(
        self, frame: BodyFrame, expected: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """As ``StaticCameras.measure``, of what stations say of segments that the body has."""
        if not frame.said:
            return None
        index = self._body.segment_index
        evidence = {
            name: [each for each in said.evidence if each.segment in index] for name, said in frame.said.items()
        }
        confidence = {
            name: np.array([said.confidence.get(segment, 0.0) for segment in self._body.segments])
            for name, said in frame.said.items()
        }
        heard = [each for said in evidence.values() for each in said]
        poses = self._together([*heard, *known], expected, dt_s)
        self._seen, self._seen_ns = poses, frame.stamp_ns
        information = np.zeros((len(poses), 6, 6))
        for each in heard:
            information[index[each.segment]] += np.linalg.inv(each.covariance)
        seen = sorted({index[each.segment] for each in heard})
        together = [SegmentPose(self._body.segments[row], poses[row], np.linalg.inv(information[row])) for row in seen]
        return StaticMeasurement(evidence, together, poses, confidence, surface_variances=surface_variances(self._body))

    def _together(self, heard: Collection[SegmentPose], expected: Array, dt_s: float) -> Array:
        """Poses (S, 4, 4) of the body as a whole under all that is said of its segments."""
        start = self._step.closed(expected)
        at = placed_expectation(start) if dt_s == 0.0 else followed(start, dt_s, self._motion)
        rows: NDArray[np.int64] = np.array([self._body.segment_index[each.segment] for each in heard], np.int64)
        said = np.array([each.world_T_segment for each in heard]).reshape(-1, 4, 4)
        weights = np.linalg.inv(np.array([each.covariance for each in heard]).reshape(-1, 6, 6))
        information = np.zeros((len(start), 6, 6))
        np.add.at(information, rows, weights)
        poses = start
        for _ in range(_ROUNDS):
            vector = np.zeros((len(start), 6))
            np.add.at(vector, rows, (weights @ log_se3(inverse(poses[rows]) @ said)[..., None])[..., 0])
            poses = self._step.moved(poses, information, vector, at)
        return poses
