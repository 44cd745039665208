"""Measurements of static cameras for the solver (B 2), from their images; live, in a replay and in a library alike."""

import logging
from collections.abc import Callable, Collection, Mapping

import numpy as np

from bodycam_ros.body_state import BodyFrame, SegmentPose
from bodycam_ros.camera.camera_image import CameraImage, check_image_size, decode_colour
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras.articulated_step import PredictedBody
from bodycam_ros.static_cameras.keypoint_evidence import KeypointEvidence
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.start_file import PlacedBody, placed_segments
from bodycam_ros.static_cameras.static_camera import Image, StaticCamera

logger = logging.getLogger(__name__)

_FOLLOWED = np.repeat([0.03, 0.01], 3)
"""[rad], [m] errors of the pose that a prediction starts from."""


def predicted_body(world_T_segment: Array, dt_s: float, motion: MotionSettings) -> PredictedBody:
    """Prediction of a body at poses (S, 4, 4) ``dt_s`` after it was measured, with its sigmas."""
    accelerations = np.repeat([motion.angular_acceleration_sigma, motion.acceleration_sigma], 3)
    sigmas = np.hypot(accelerations * dt_s**2, _FOLLOWED)
    return PredictedBody(world_T_segment, sigmas, float(np.sqrt(2.0) * sigmas[0]))


class ImageMeasurement:
    """Measures the body in decoded images.

    Args:
        tracker: of the body in all stations' images.
        placed: initial pose given by hand; None without one.
        motion: sigmas of the segments' accelerations.
        on_seen: called with the stamp of each camera's image [ns], and the measurement.
        keypoints: in the images; None without.
    """

    def __init__(
        self,
        tracker: RegionTracker,
        placed: PlacedBody | None,
        motion: MotionSettings,
        on_seen: Callable[[Mapping[str, int], StaticMeasurement], None] = lambda stamps_ns, seen: None,
        keypoints: KeypointEvidence | None = None,
    ) -> None:
        self._keypoints = keypoints
        self._tracker, self._placed = tracker, placed
        self._stations = {name: view.station for name, view in tracker.views.items()}
        self._motion, self._on_seen = motion, on_seen
        self._unreadable: set[str] = set()
        self._has_colours = False
        self._latest: tuple[int, Array] | None = None  # stamp [ns] and measured poses (S, 4, 4)

    def place(self, frame: BodyFrame) -> list[SegmentPose]:
        """As ``StaticCameras.place``: by the start that was given, and after a gap where the body was before it.

        Nothing without a start, or without an image. The start counts again where stamps went back.
        """
        if self._placed is None:
            return []
        if self._latest is not None and frame.stamp_ns >= self._latest[0]:
            return placed_segments(self._tracker.body, self._latest[1])
        pictures = decode_images(frame.images, self._stations, self._unreadable)
        if not pictures:
            return []
        self._tracker.restart()
        self._latest, self._has_colours = None, True
        poses = self._tracker.initialise(pictures, self._placed.world_T_segment, self._placed.unplaced)
        return placed_segments(self._tracker.body, poses)

    def measure(
        self, frame: BodyFrame, predicted: Array, dt_s: float, known: Collection[SegmentPose]
    ) -> StaticMeasurement | None:
        """As ``StaticCameras.measure``; in the first images a body placed by body cameras is searched as a whole."""
        pictures = decode_images(frame.images, self._stations, self._unreadable)
        if not pictures:
            return None
        if self._latest is not None and frame.stamp_ns < self._latest[0]:
            self._tracker.restart()
            self._latest, self._has_colours = None, False
        if not self._has_colours and not known:
            return None
        if not self._has_colours:
            predicted = self._tracker.find_limbs(pictures, predicted, known)
            self._has_colours = True
        stamps_ns = {name: frame.images[name].stamp_ns for name in pictures}
        agreed = self._keypoints.agreed(pictures, stamps_ns, predicted) if self._keypoints else None
        seen = self._tracker.measure(pictures, predicted_body(predicted, dt_s, self._motion), known, agreed)
        self._latest = frame.stamp_ns, seen.world_T_segment
        self._on_seen(stamps_ns, seen)
        return seen


def decode_images(
    images: Mapping[str, CameraImage], stations: Mapping[str, StaticCamera], unreadable: set[str]
) -> dict[str, Image]:
    """Decoded images of static cameras; a warning names the first of each camera that cannot be used."""
    pictures = {}
    for name, image in images.items():
        try:
            check_image_size(image, stations[name].camera)
            picture = decode_colour(image)
            stations[name].check_size(picture)
        except RecordingError as error:
            if name not in unreadable:
                logger.warning("%s; this and similar images are dropped", error)
            unreadable.add(name)
        else:
            pictures[name] = picture
    return pictures
