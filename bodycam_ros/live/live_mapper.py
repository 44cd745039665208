"""Map extension while cameras are registered live: keyframes are requested, and processed when no image waits."""

from collections.abc import Callable

from bodycam_ros.camera import CameraModel
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeSelection
from bodycam_ros.mapping.extendable_map import AddedLandmarks, make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper
from bodycam_ros.mapping.map_settings import GrowthSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import TrackFrame


class LiveMapper:
    """One extendable map for some cameras.

    Args:
        reference_map: the map that is extended; it is not changed itself.
        settings: whether, and by how much at most.
        request_keyframe: requests new features from a camera's tracker.
        defer: calls back once, after the images that wait by now have been registered.

    Attributes:
        map: the map in which the cameras are registered.
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
        self.map = make_extendable(reference_map, settings.capacity)
        self.enabled = settings.enabled
        self.dropped = 0
        self._request_keyframe, self._defer = request_keyframe, defer
        self._cameras: dict[str, CameraModel] = {}
        self._selections: dict[str, KeyframeSelection] = {}
        self._pending: dict[str, BodyKeyframe] = {}
        self._mapper = LocalMapper(self.map, self._cameras)

    @property
    def changes(self) -> int:
        """How often the map has changed."""
        return self.map.changes

    @property
    def landmarks(self) -> int:
        """Number of added landmarks."""
        return self._mapper.landmarks

    @property
    def keyframes(self) -> int:
        """Number of keyframes that new ones are matched with."""
        return self._mapper.keyframes

    def start_camera(self, camera: str, model: CameraModel) -> None:
        """Start, or restart, the tracks of a camera."""
        self._cameras[camera] = model
        self._selections[camera] = KeyframeSelection(model)

    def update(self, frame: TrackFrame, matches: LandmarkMatches) -> None:
        """Process one registered image of a camera that was started."""
        if not self.enabled:
            return
        camera, selection = matches.camera, self._selections[matches.camera]
        self._mapper.update(matches)
        self._mapper.take_changes()
        keyframe = selection.take_keyframe(frame, matches)
        if keyframe is not None:
            self.dropped += camera in self._pending
            self._pending[camera] = keyframe
            self._defer(self._add_keyframe)
        elif selection.is_due(matches):
            self._request_keyframe(camera)

    def clear(self) -> int:
        """Remove all added landmarks; returns how many there were."""
        removed = self.landmarks
        self._pending.clear()
        self._mapper.clear()
        self._mapper.take_changes()
        return removed

    def restore(self, added: AddedLandmarks) -> int:
        """Replace the added landmarks by those of an earlier run; returns how many there was room for."""
        self.clear()
        count = self._mapper.restore(added)
        self._mapper.take_changes()
        return count

    def _add_keyframe(self) -> None:
        """Process one pending keyframe."""
        if self._pending and self.enabled:
            self._mapper.add_keyframe(self._pending.pop(next(iter(self._pending))))
            self._mapper.take_changes()
