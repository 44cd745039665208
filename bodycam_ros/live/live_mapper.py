"""Map extension while cameras are registered live: keyframes are requested, and processed when no image waits."""

from collections.abc import Callable

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeSelection
from bodycam_ros.mapping.extendable_map import make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper
from bodycam_ros.mapping.map_settings import GrowthSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame


class LiveMapper(LocalMapper):
    """Extends one map by some cameras that are registered in it.

    Args:
        reference_map: the map that is extended; it is not changed itself.
        settings: whether, and by how much at most.
        request_keyframe: requests new features from a camera's tracker.
        defer: calls back once, after the images that wait by now have been registered.

    Attributes:
        enabled: whether landmarks are added and removed.
        dropped: keyframes that were replaced by a newer one of their camera before they were processed.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        settings: GrowthSettings,
        request_keyframe: Callable[[str], None],
        defer: Callable[[Callable[[], None]], None],
    ) -> None:
        super().__init__(make_extendable(reference_map, settings.capacity))
        self.enabled = settings.enabled
        self.dropped = 0
        self._request_keyframe, self._defer = request_keyframe, defer
        self._selections: dict[str, KeyframeSelection] = {}
        self._pending: dict[str, BodyKeyframe] = {}

    def start_camera(self, camera: str, model: CameraModel) -> None:
        """Start, or restart, the tracks of a camera."""
        self._selections[camera] = KeyframeSelection(model)

    def add_image(self, frame: TrackFrame, matches: LandmarkMatches) -> None:
        """Process one registered image of a camera that was started."""
        if not self.enabled:
            return
        camera, selection = matches.camera, self._selections[matches.camera]
        self.update(matches)
        keyframe = selection.take_keyframe(frame, matches)
        if keyframe is not None:
            self.dropped += camera in self._pending
            self._pending[camera] = keyframe
            self._defer(self._add_pending)
        elif selection.is_due(matches):
            self._request_keyframe(camera)

    def _add_pending(self) -> None:
        """Process one pending keyframe."""
        if self._pending and self.enabled:
            self.add_keyframe(self._pending.pop(next(iter(self._pending))))
            self.take_changes()
