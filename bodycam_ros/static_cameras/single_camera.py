"""A static camera alone, live: each of its images measures the segments that it shows.

The solver's state is accurate but late; the camera's own measurements since then are recent but of one view. So the
body is predicted from the solver's state by the motion that the camera has measured since, and from there at constant
velocity.
"""

from collections import deque

import numpy as np

from bodycam_ros.body_state import BodyFrame, LatestState, SegmentMeasurements, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.estimation.motion_model import MotionSettings, orthonormal
from bodycam_ros.estimation.motion_model import predict as predict_poses
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import PlacedBody
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement

_MAX_KEPT = 100
"""States, and measurements: some seconds, more than the solver's latency."""

_MAX_PREDICTION_S = 0.5
"""A body is predicted for so long; after a longer gap it stays at its last pose."""


class BodyPredictor:
    """Predicts a body from the solver's states and the camera's measurements."""

    def __init__(self) -> None:
        self._states: deque[LatestState] = deque(maxlen=_MAX_KEPT)
        # Stamps [ns] and poses (S, 4, 4) since the latest state, moved so that they continue it.
        self._measured: deque[tuple[int, Array]] = deque(maxlen=_MAX_KEPT)

    def add_state(self, body: LatestState) -> None:
        """Add a state of the solver; later ones are removed: stamps went back."""
        before = self._known(body.stamp_ns)
        while self._states and self._states[-1].stamp_ns >= body.stamp_ns:
            self._states.pop()
        self._states.append(body)
        while self._measured and self._measured[0][0] <= body.stamp_ns:
            self._measured.popleft()
        if before and self._measured:
            (begin_ns, begin), (end_ns, end) = before[-1], self._measured[0]
            share = (body.stamp_ns - begin_ns) / (end_ns - begin_ns)
            correction = body.world_T_segment @ inverse(begin @ exp_se3(share * log_se3(inverse(begin) @ end)))
            moved = [(stamp_ns, orthonormal(correction @ poses)) for stamp_ns, poses in self._measured]
            self._measured = deque(moved, _MAX_KEPT)

    def add_measurement(self, stamp_ns: int, world_T_segment: Array) -> None:
        """Add measured poses (S, 4, 4), later than those before; ones that the solver is ahead of are not needed."""
        if not self._states or stamp_ns > self._states[-1].stamp_ns:
            self._measured.append((stamp_ns, world_T_segment))

    def latest_state(self, stamp_ns: int) -> LatestState | None:
        """The solver's latest state up to a time."""
        return next((body for body in reversed(self._states) if body.stamp_ns <= stamp_ns), None)

    def predict(self, stamp_ns: int) -> tuple[Array, float] | None:
        """Predicted poses (S, 4, 4) at a time, and the time since the latest measurement [s]; None if unknown."""
        known = self._known(stamp_ns)
        if not known:
            return None
        latest_ns, poses = known[-1]
        ahead_s = 1e-9 * (stamp_ns - latest_ns)
        if ahead_s > _MAX_PREDICTION_S:
            return poses, _MAX_PREDICTION_S
        if len(known) < 2:
            return poses, ahead_s
        before_ns, before = known[-2]
        return predict_poses(before, poses, 1e-9 * (latest_ns - before_ns), ahead_s), ahead_s

    def _known(self, stamp_ns: int) -> list[tuple[int, Array]]:
        """The latest stamps, two at most, up to this one with known poses (S, 4, 4), and these."""
        known = [*((body.stamp_ns, body.world_T_segment) for body in self._states), *self._measured]
        return [each for each in known if each[0] <= stamp_ns][-2:]


class SingleCamera:
    """Measures the body in each of its images.

    Args:
        name: of the camera.
        tracker: of the body in its images alone.
        placed: initial pose given by hand; None without one.
        motion: sigmas of the segments' accelerations.
    """

    def __init__(self, name: str, tracker: RegionTracker, placed: PlacedBody | None, motion: MotionSettings) -> None:
        self._name, self._placed = name, placed
        self._body = tracker.body
        self._watch = ImageMeasurement(tracker, placed, motion)
        self._predictor = BodyPredictor()
        self._initialised = False

    def add_state(self, body: LatestState) -> None:
        """Add a state of the solver."""
        self._predictor.add_state(body)

    def has_pose(self, stamp_ns: int) -> bool:
        """Whether the solver or its own images give the body's pose at a time."""
        return self._initialised or self._solver_state(stamp_ns) is not None

    def measure(self, image: CameraImage) -> SegmentMeasurements | None:
        """Measure the body in the next image.

        None while the body's pose is unknown, and for an unusable image, of which ``ImageMeasurement`` warns.
        """
        frame = BodyFrame(image.stamp_ns, {}, {self._name: image})
        seen = self._measure_known(frame) if self._initialised else self._measure_first(frame)
        if seen is None:
            return None
        self._initialised = True
        self._predictor.add_measurement(image.stamp_ns, seen.world_T_segment)
        shares = seen.confidence[self._name].tolist()
        confidence = dict(zip(self._body.segments, shares, strict=True))
        return SegmentMeasurements(self._name, image.stamp_ns, tuple(seen.evidence[self._name]), confidence)

    def _solver_state(self, stamp_ns: int) -> LatestState | None:
        """The solver's latest state, if it has observed segments and is not its first: limbs need a moving trunk."""
        received = self._predictor.latest_state(stamp_ns)
        if (
            received is None
            or not received.observed.any()
            or self._predictor.latest_state(received.stamp_ns - 1) is None
        ):
            return None
        return received

    def _measure_known(self, frame: BodyFrame) -> StaticMeasurement | None:
        predicted = self._predictor.predict(frame.stamp_ns)
        return None if predicted is None else self._watch.measure(frame, *predicted, ())

    def _measure_first(self, frame: BodyFrame) -> StaticMeasurement | None:
        received = self._solver_state(frame.stamp_ns)
        predicted = self._predictor.predict(frame.stamp_ns)
        if received is not None and predicted is not None:
            poses, ahead_s = predicted
            known = [
                SegmentPose(self._body.segments[row], poses[row], received.covariances[row])
                for row in np.flatnonzero(received.observed).tolist()
            ]
            return self._watch.measure(frame, poses, ahead_s, known)
        begun = self._watch.place(frame)
        if self._placed is None or not begun:
            return None
        poses = self._placed.world_T_segment.copy()
        for each in begun:
            poses[self._body.segment_index[each.segment]] = each.world_T_segment
        return self._watch.measure(frame, poses, 0.0, ())
