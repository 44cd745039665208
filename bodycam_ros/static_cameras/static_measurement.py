"""Measurements of static cameras for the solver (B 2): from their images, or from their own processes' messages."""

import logging
from collections.abc import Callable, Collection, Mapping

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyFrame, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage, decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.motion_model import MotionSettings, motion_sigmas
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.articulated_step import ArticulatedStep, PredictedBody
from bodycam_ros.static_cameras.limb_search import with_usual_limits
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.segment_support import surface_variances
from bodycam_ros.static_cameras.start_file import START_JOINT_RAD, START_SIGMAS, PlacedBody, placed_segments
from bodycam_ros.static_cameras.station import Image, Station

logger = logging.getLogger(__name__)

_FOLLOWED = np.repeat([0.03, 0.01], 3)
"""[rad], [m] errors of the pose that a prediction starts from."""


def predicted_body(world_T_segment: Array, dt_s: float, motion: MotionSettings) -> PredictedBody:
    """Prediction of a body at poses (S, 4, 4) ``dt_s`` after it was measured, with its sigmas."""
    sigmas = np.hypot(motion_sigmas(dt_s, dt_s, motion), _FOLLOWED)
    return PredictedBody(world_T_segment, sigmas, float(np.sqrt(2.0) * sigmas[0]))


class ImageMeasurement:
    """Measures the body in decoded images.

    Args:
        tracker: of the body in all stations' images.
        placed: initial pose given by hand; None without one.
        motion: sigmas of the segments' accelerations.
        on_seen: called with the stamp of each camera's image [ns], and the measurement.
    """

    def __init__(
        self,
        tracker: RegionTracker,
        placed: PlacedBody | None,
        motion: MotionSettings,
        on_seen: Callable[[Mapping[str, int], StaticMeasurement], None] = lambda stamps_ns, seen: None,
    ) -> None:
        self._tracker, self._placed = tracker, placed
        self._stations = {name: view.station for name, view in tracker.views.items()}
        self._motion, self._on_seen = motion, on_seen
        self._unreadable: set[str] = set()
        self._has_colours = False

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``StaticCameras.place``: once, and nothing without a placed body, or without an image."""
        pictures = {} if self._placed is None else decode_images(frame.images, self._stations, self._unreadable)
        if self._placed is None or not pictures:
            return []
        poses = self._tracker.initialise(pictures, self._placed.world_T_segment, self._placed.unplaced)
        self._placed, self._has_colours = None, True
        return placed_segments(self._tracker.body, poses)

    def measure(
        self, frame: BodyFrame, predicted: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """As ``StaticCameras.measure``; in the first images a body placed by body cameras is searched as a whole."""
        pictures = decode_images(frame.images, self._stations, self._unreadable)
        if not pictures:
            return None
        if not self._has_colours and not known:
            return None
        if not self._has_colours:
            predicted = self._tracker.find_limbs(pictures, predicted, known)
            self._has_colours = True
        seen = self._tracker.measure(pictures, predicted_body(predicted, dt_s, self._motion), known)
        self._on_seen({name: frame.images[name].stamp_ns for name in pictures}, seen)
        return seen


def decode_images(
    images: Mapping[str, CameraImage], stations: Mapping[str, Station], unreadable: set[str]
) -> dict[str, Image]:
    """Decoded images of static cameras; a warning names the first of each camera that cannot be used."""
    pictures = {}
    for name, image in images.items():
        try:
            picture = decode_colour(image)
            stations[name].check_size(picture)
        except RecordingError as error:
            if name not in unreadable:
                logger.warning("%s; this and similar images are dropped", error)
            unreadable.add(name)
        else:
            pictures[name] = picture
    return pictures


_ROUNDS = 3
"""Gauss-Newton steps of the body as a whole; only rotations are not linear."""


class ReportedMeasurement:
    """Combines the cameras' reports on a body, joints closed, as ``RegionTracker`` does with all their images.

    Args:
        body: segments and joints, with people's usual limits where it has none; with its equipment, if any.
        placed: (S, 4, 4) initial pose given by hand; None without one.
        motion: sigmas of the segments' accelerations.
    """

    def __init__(self, body: BodyModel, placed: Array | None, motion: MotionSettings) -> None:
        self._body, self._placed = body, placed
        self._motion = motion
        self._step = ArticulatedStep(with_usual_limits(body))
        self._seen: Array | None = None
        self._seen_ns = 0

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``StaticCameras.place``: nothing without an initial pose, or before the first report.

        After a gap it is the last measured pose; the initial one only if stamps went back.
        """
        if self._placed is None or not frame.measured:
            return []
        poses = self._placed if self._seen is None or frame.stamp_ns <= self._seen_ns else self._seen
        return placed_segments(self._body, poses)

    def measure(
        self, frame: BodyFrame, predicted: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """As ``StaticCameras.measure``, by reports on segments of the body."""
        if not frame.measured:
            return None
        index = self._body.segment_index
        evidence = {
            name: [each for each in report.evidence if each.segment in index] for name, report in frame.measured.items()
        }
        confidence = {
            name: np.array([report.confidence.get(segment, 0.0) for segment in self._body.segments])
            for name, report in frame.measured.items()
        }
        received = [each for measured in evidence.values() for each in measured]
        poses = self._together([*received, *known], predicted, dt_s)
        self._seen, self._seen_ns = poses, frame.stamp_ns
        information = np.zeros((len(poses), 6, 6))
        for each in received:
            information[index[each.segment]] += np.linalg.inv(each.covariance)
        seen = sorted({index[each.segment] for each in received})
        together = [SegmentPose(self._body.segments[row], poses[row], np.linalg.inv(information[row])) for row in seen]
        return StaticMeasurement(evidence, together, poses, confidence, surface_variances=surface_variances(self._body))

    def _together(self, received: Collection[SegmentPose], predicted: Array, dt_s: float) -> Array:
        """Poses (S, 4, 4) of the body as a whole under all measurements of its segments."""
        start = self._step.close_joints(predicted)
        prior = predicted_body(start, dt_s, self._motion)
        if dt_s == 0.0:
            prior = PredictedBody(start, START_SIGMAS, START_JOINT_RAD)
        rows = [self._body.segment_index[each.segment] for each in received]
        measured = np.array([each.world_T_segment for each in received]).reshape(-1, 4, 4)
        information = np.linalg.inv(np.array([each.covariance for each in received]).reshape(-1, 6, 6))
        return self._step.fit(start, rows, measured, information, prior, _ROUNDS)
