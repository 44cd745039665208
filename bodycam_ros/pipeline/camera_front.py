"""One camera from its images to its registrations (A 4.1), for the library, the replay's workers and two nodes.

image --track--> TrackFrame --register--> LandmarkMatches --accept--> what the next image is tracked from

The library and a replay's worker take all three steps for an image (``process``). In the live graph the tracker's node
tracks and accepts, the registration's node registers: each drives a front of its own, and tracks and landmarks go over
the wire between them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import UNKNOWN_READOUT, Readout
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeDensity, KeyframeSelection
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.landmark_tracker import LandmarkTracker, TrackedCamera
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import RegisteredCamera, Registrar, RegistrarSettings
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.track_frame import TrackFrame


@dataclass(frozen=True)
class KnownCamera:
    """What is known of a camera between two of its images: by its tracker, and by its registrar."""

    tracked: TrackedCamera
    registered: RegisteredCamera


class CameraFront:
    """Tracks and registers the images of one camera, in order of time.

    Args:
        camera: its model.
        reference_map: what its tracker finds landmarks by; None, or one without photographs: it tracks features alone.
        settings: of all stages.
        readout: read-out time of its rows, as far as it is known before the first image.
        turn: rotations by its gyroscope; None without one.
        registered_in: the map that it is registered in, if not ``reference_map``; the same with room for more
            landmarks.
        keyframes: how many images become keyframes that may extend a map; None: none do.

    Attributes:
        known: what is known between two images.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap | None,
        settings: PipelineSettings,
        readout: Readout | None = None,
        *,
        turn: CameraTurn | None = None,
        registered_in: ReferenceMap | None = None,
        keyframes: KeyframeDensity | None = None,
    ) -> None:
        self._camera = camera
        self._map = reference_map
        self._settings = settings
        self._turn = turn
        self._registered_in = reference_map if registered_in is None else registered_in
        self._keyframes = None if keyframes is None else KeyframeSelection(camera, keyframes)
        start = readout or UNKNOWN_READOUT
        self.known = KnownCamera(TrackedCamera(start), RegisteredCamera(start))

    @cached_property
    def _tracker(self) -> LandmarkTracker:
        features = FeatureTracker(self._camera, self._settings.keypoints)
        return LandmarkTracker(features, self._map, self._settings.direct, self._settings.pose_fit, self._turn)

    @cached_property
    def _registrar(self) -> Registrar:
        if self._registered_in is None:
            raise ValueError(f"camera {self._camera.name}: without a map it can be tracked, but not registered")
        return Registrar(self._camera, self._registered_in, self._settings.registrar, self._settings.pose_fit)

    def process(
        self, image: NDArray[np.uint8], stamp_ns: int
    ) -> tuple[TrackFrame, LandmarkMatches, BodyKeyframe | None]:
        """Track and register the next image; what the map may grow by, if it is a keyframe.

        Args:
            image: (H, W) grey image of the camera's size.
            stamp_ns: mid-exposure of its middle row [ns], later than that of the image before.

        Raises:
            RecordingError: as ``track``.
        """
        tracks = self.track(image, stamp_ns)
        matches = self.register(tracks)
        self.accept(matches)
        if self._keyframes is None:
            return tracks, matches, None
        keyframe = self._keyframes.take_keyframe(tracks, matches)
        if keyframe is None and self._keyframes.is_due(matches):
            self.want_keyframe()
        return tracks, matches, keyframe

    def track(self, image: NDArray[np.uint8], stamp_ns: int) -> TrackFrame:
        """The tracks of the next image (H, W), with a pose where its landmarks were found (A eq. 2).

        Raises:
            RecordingError: the image has another size than the camera model, or its stamp does not advance.
        """
        tracked, tracks = self._tracker.track(self.known.tracked, image, stamp_ns)
        self.known = KnownCamera(tracked, self.known.registered)
        return tracks

    def register(self, tracks: TrackFrame) -> LandmarkMatches:
        """The camera's pose in the map, judged or fitted, and the landmarks of its tracks (A eq. 8, first term)."""
        registered, matches = self._registrar.register(self.known.registered, tracks)
        self.known = KnownCamera(self.known.tracked, registered)
        return matches

    def accept(self, matches: LandmarkMatches) -> None:
        """Go on tracking from the registration of the latest image or, live, of one before it."""
        tracked = self._tracker.add_registration(self.known.tracked, matches)
        self.known = KnownCamera(tracked, self.known.registered)

    def want_keyframe(self) -> None:
        """Make the next image a keyframe: for a registrar that starts anew, or a map that is to grow."""
        self._tracker.want_keyframe()

    def set_readout(self, readout: Readout) -> None:
        """Register by a read-out time of another source, if it is better known than the present one."""
        self.known = KnownCamera(self.known.tracked, self.known.registered.with_readout(readout))

    def set_registrar(self, settings: RegistrarSettings) -> None:
        """Register the next images by other settings."""
        self._registrar.settings = settings


def camera_fronts(
    cameras: Mapping[str, CameraModel],
    reference_map: ReferenceMap,
    settings: PipelineSettings,
    *,
    readouts: Mapping[str, Readout | None],
    turns: Mapping[str, CameraTurn],
    registered_in: ReferenceMap | None = None,
    keyframes: KeyframeDensity | None = None,
) -> dict[str, CameraFront]:
    """The fronts of some cameras in one map; arguments as of ``CameraFront``, by camera where each has its own.

    A map that grows (``registered_in``) grows by keyframes, as many as ``KeyframeDensity`` has by itself.
    """
    if keyframes is None and registered_in is not None:
        keyframes = KeyframeDensity()
    return {
        name: CameraFront(
            camera,
            reference_map,
            settings,
            readouts.get(name),
            turn=turns.get(name),
            registered_in=registered_in,
            keyframes=keyframes,
        )
        for name, camera in cameras.items()
    }
